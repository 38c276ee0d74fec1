// The whole network for a block of samples: a workgroup keeps the block's activations in shared memory from the input
// to the output (Müller et al. 2021, fully fused networks).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_mlp.h"
#include "mlp_tile.glsl"

KERNEL_ARGUMENTS(MlpForwardArguments)

// Columns [first, first + count) of the block's input; padding and samples beyond the last are zero.
void loadInput(MatrixArguments m, uint firstSample, uint samples, uint first, uint count) {
  barrier();
  for (uint i = gl_LocalInvocationIndex; i < kBlock * count; i += kThreads) {
    const uint row = i / count, column = i % count;
    const bool inside = firstSample + row < samples && first + column < m.columns;
    state[row * kStride + column] = inside ? m.data.values[elementOf(m, firstSample + row, first + column)] : 0;
  }
}

void forward(MlpForwardArguments a, uint firstSample, uint samples) {
  clearSums();
  for (uint first = 0; first < a.paddedInputs; first += kWidth) {
    const uint count = min(kWidth, a.paddedInputs - first);
    loadInput(a.inputs, firstSample, samples, first, count);
    accumulate(a.weights, first, 1, a.paddedInputs, count, kWidth);
  }

  uint offset = a.paddedInputs * kWidth;  // of the next layer's weights
  for (uint layer = 0; layer < a.hiddenLayers; ++layer) {
    barrier();
    [[unroll]] for (uint r = 0; r < kRows; ++r) {
      [[unroll]] for (uint c = 0; c < kColumns; ++c) {
        state[stateRow(r) * kStride + stateColumn(c)] = max(sums[r * kColumns + c], 0);
      }
    }
    if (WANTED(a.activations)) {
      barrier();
      const uint base = (layer * a.samples.capacity + firstSample) * kWidth;
      const uint rows = min(kBlock, samples - firstSample);
      for (uint i = gl_LocalInvocationIndex; i < rows * kWidth; i += kThreads) {
        a.activations.values[base + i] = state[i / kWidth * kStride + i % kWidth];
      }
    }
    if (layer + 1 < a.hiddenLayers) {
      clearSums();
      accumulate(a.weights, offset, 1, kWidth, kWidth, kWidth);
      offset += kWidth * kWidth;
    }
  }

  for (uint first = 0; first < a.paddedOutputs; first += kWidth) {
    clearSums();
    accumulate(a.weights, offset + first * kWidth, 1, kWidth, kWidth, min(kWidth, a.paddedOutputs - first));
    [[unroll]] for (uint r = 0; r < kRows; ++r) {
      [[unroll]] for (uint c = 0; c < kColumns; ++c) {
        const uint row = firstSample + stateRow(r), column = first + stateColumn(c);
        if (row >= samples || column >= a.outputs.columns) continue;
        const float sum = sums[r * kColumns + c];
        a.outputs.data.values[elementOf(a.outputs, row, column)] =
            a.sigmoidOutput != 0 ? 1 / (1 + exp(-sum)) : sum;
      }
    }
  }
}

void main() {
  const uint begin = firstOf(arguments.values.samples), samples = endOf(arguments.values.samples);
  FOR_EACH_BLOCK(firstSample, begin, samples) forward(arguments.values, firstSample, samples);
}
