// Gradients from the outputs back to the inputs for a block of samples, in shared memory all the way. Those of each
// layer's sums are written out for mlp_weight_gradients.comp.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_mlp.h"
#include "mlp_tile.glsl"

KERNEL_ARGUMENTS(MlpBackwardArguments)

// state ← the gradient of the output layer's sums.
void loadOutputGradients(MlpBackwardArguments a, uint firstSample, uint samples) {
  barrier();
  for (uint i = gl_LocalInvocationIndex; i < kBlock * a.paddedOutputs; i += kThreads) {
    const uint row = i / a.paddedOutputs, column = i % a.paddedOutputs;
    const uint index = firstSample + row;
    float gradient = 0;
    if (index < samples) {
      if (column < a.outputGradients.columns) {
        gradient = a.outputGradients.data.values[elementOf(a.outputGradients, index, column)];
        if (column == 0 && WANTED(a.firstOutputGradients)) gradient += a.firstOutputGradients.values[index];
        if (a.sigmoidOutput != 0) {
          const float y = a.outputs.data.values[elementOf(a.outputs, index, column)];
          gradient *= y * (1 - y);
        }
      }
      a.lastGradients.values[index * a.paddedOutputs + column] = gradient;
    }
    state[row * kStride + column] = gradient;
  }
}

void backward(MlpBackwardArguments a, uint firstSample, uint samples) {
  const uint rows = min(kBlock, samples - firstSample);

  loadOutputGradients(a, firstSample, samples);
  uint depth = a.paddedOutputs;
  for (uint layer = a.hiddenLayers; layer > 0; --layer) {
    const uint offset = a.paddedInputs * kWidth + (layer - 1) * kWidth * kWidth;  // of this layer's weights
    clearSums();
    accumulate(a.weights, offset, kWidth, 1, depth, kWidth);
    barrier();
    [[unroll]] for (uint r = 0; r < kRows; ++r) {
      [[unroll]] for (uint c = 0; c < kColumns; ++c) {
        state[stateRow(r) * kStride + stateColumn(c)] = sums[r * kColumns + c];
      }
    }
    barrier();
    const uint base = ((layer - 1) * a.samples.capacity + firstSample) * kWidth;
    for (uint i = gl_LocalInvocationIndex; i < rows * kWidth; i += kThreads) {
      const uint at = i / kWidth * kStride + i % kWidth;
      if (!(a.activations.values[base + i] > 0)) state[at] = 0;  // ReLU was off
      a.hiddenGradients.values[base + i] = state[at];
    }
    depth = kWidth;
  }

  if (!WANTED(a.inputGradients.data)) return;
  for (uint first = 0; first < a.inputGradients.columns; first += kWidth) {
    clearSums();
    accumulate(a.weights, first, a.paddedInputs, 1, kWidth, min(kWidth, a.paddedInputs - first));
    [[unroll]] for (uint r = 0; r < kRows; ++r) {
      [[unroll]] for (uint c = 0; c < kColumns; ++c) {
        const uint row = firstSample + stateRow(r), column = first + stateColumn(c);
        if (row >= samples || column >= a.inputGradients.columns) continue;
        a.inputGradients.data.values[elementOf(a.inputGradients, row, column)] = sums[r * kColumns + c];
      }
    }
  }
}

void main() {
  const uint begin = firstOf(arguments.values.samples), samples = endOf(arguments.values.samples);
  FOR_EACH_BLOCK(firstSample, begin, samples) backward(arguments.values, firstSample, samples);
}
