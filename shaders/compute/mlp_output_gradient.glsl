// Gradients of an MLP's output layer with respect to the values before its activation, and the scale that keeps the
// gradients of all layers within fp16.
// Include after arguments_mlp.h. Reads: kThreads, the size of a workgroup, a power of two. Defines: outputGradient(),
// groupMaximum(), lossScale().

// Returns 0 for padding columns.
float outputGradient(MlpOutputArguments a, uint row, uint column) {
  if (column >= a.gradients.columns) return 0;
  float gradient = a.gradients.data.values[elementIndex(a.gradients, row, column)];
  if (column == 0 && IS_SET(a.firstGradients)) gradient += a.firstGradients.values[row];
  if (a.sigmoid != 0) {
    const float y = a.values.data.values[elementIndex(a.values, row, column)];
    gradient *= y * (1 - y);
  }
  return gradient;
}

shared float maxima[kThreads];

// Returns the largest value of a workgroup's invocations, which must call it together.
float groupMaximum(float value) {
  maxima[gl_LocalInvocationIndex] = value;
  for (uint other = kThreads / 2; other > 0; other /= 2) {
    barrier();
    if (gl_LocalInvocationIndex < other) {
      maxima[gl_LocalInvocationIndex] = max(maxima[gl_LocalInvocationIndex], maxima[gl_LocalInvocationIndex + other]);
    }
  }
  barrier();
  return maxima[0];
}

// Returns a power of two that scales the largest of `largest` to [64, 128): earlier layers may increase it a few
// hundred times, and numbers 2⁻²⁰ times smaller still have full fp16 precision. As the scale is computed from the
// gradients themselves, it needs neither history nor skipped steps. Returns 1 for an empty list, and NaN if a value is
// infinite, so that all gradients become NaN.
// All invocations of a workgroup must call it together.
float lossScale(FloatPointer largest, uint count) {
  float maximum = 0;
  for (uint i = gl_LocalInvocationIndex; i < count; i += kThreads) maximum = max(maximum, largest.values[i]);
  maximum = groupMaximum(maximum);
  const int exponent = int(floatBitsToUint(maximum) >> 23) - 127;
  if (maximum == 0) return 1;
  if (exponent == 128) return uintBitsToFloat(0x7fc00000u);
  return uintBitsToFloat(uint(clamp(6 - exponent, -100, 100) + 127) << 23);
}
