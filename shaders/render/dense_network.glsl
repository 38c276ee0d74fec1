// Evaluates a network of a content, one invocation per ray.
// Reads: LayersPointer, FloatPointer; kMaxWidth, no less than any layer has inputs or outputs. Defines: runNetwork().

// Computes outputs = weights · inputs + biases per layer, with ReLU after each layer but the last, in place.
void runNetwork(LayersPointer layers, uint count, FloatPointer weights, inout float values[kMaxWidth]) {
  float next[kMaxWidth];
  for (uint l = 0; l < count; ++l) {
    LayerArguments layer = layers.values[l];
    const uint biases = layer.firstWeight + layer.inputs * layer.outputs;
    for (uint o = 0; o < layer.outputs; ++o) {
      float sum = weights.values[biases + o];
      const uint row = layer.firstWeight + o * layer.inputs;
      for (uint i = 0; i < layer.inputs; ++i) sum += weights.values[row + i] * values[i];
      next[o] = l + 1 < count ? max(sum, 0) : sum;
    }
    for (uint o = 0; o < layer.outputs; ++o) values[o] = next[o];
  }
}
