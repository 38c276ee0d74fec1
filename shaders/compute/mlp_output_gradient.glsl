// Gradients of an MLP's output layer, before its activation, and the scale that keeps those of all layers within fp16.
// Include after arguments_mlp.h. Defines: outputGradient(), lossScale().

// Padding columns have none.
float outputGradient(MlpOutputArguments a, uint row, uint column) {
  if (column >= a.gradients.columns) return 0;
  float gradient = a.gradients.data.values[elementOf(a.gradients, row, column)];
  if (column == 0 && WANTED(a.firstGradients)) gradient += a.firstGradients.values[row];
  if (a.sigmoid != 0) {
    const float y = a.values.data.values[elementOf(a.values, row, column)];
    gradient *= y * (1 - y);
  }
  return gradient;
}

// A power of two that brings the largest of `largest` to [64, 128): layers further back may grow it a few hundred times,
// and what is 2⁻²⁰ of it still has all bits of fp16. Chosen from the gradients themselves, it needs neither history nor
// steps that are thrown away. 1 where there is no list. Where one is infinite, no number: then none is one.
float lossScale(FloatPointer largest, uint count) {
  float most = 0;
  for (uint i = 0; i < count; ++i) most = max(most, largest.values[i]);
  const int exponent = int(floatBitsToUint(most) >> 23) - 127;
  if (most == 0) return 1;
  if (exponent == 128) return uintBitsToFloat(0x7fc00000u);
  return uintBitsToFloat(uint(clamp(6 - exponent, -100, 100) + 127) << 23);
}
