// MlpForward: the whole network for a block of samples. A workgroup keeps the block's activations in shared memory from
// the input to the output (Müller et al. 2021, fully fused networks).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "number.glsl"
#include "kernel.glsl"
#include "arguments_mlp.h"
#include "mlp_block.glsl"

KERNEL_ARGUMENTS(MlpForwardArguments)

void storeSum(uint row, uint column, float sum) {
  MatrixArguments outputs = arguments.values.outputs;
  if (row >= rowRangeEnd(arguments.values.samples) || column >= outputs.columns) return;
  if (arguments.values.sigmoidOutput != 0) sum = 1 / (1 + exp(-sum));
  outputs.data.values[elementIndex(outputs, row, column)] = sum;
}

// Loads columns [first, first + count) of the block's input; padding and samples beyond the last are zero.
void loadInput(MatrixArguments m, uint firstSample, uint samples, uint first, uint count) {
  barrier();
  for (uint column = gl_LocalInvocationIndex % 16; column < count; column += 16) {
    const bool exists = first + column < m.columns;
    const uint offset = exists ? columnOffset(m, first + column) : 0;
    [[unroll]] for (uint n = 0; n < kBlock * 16 / kThreads; ++n) {  // the loads overlap
      const uint row = n * kThreads / 16 + gl_LocalInvocationIndex / 16;
      const bool inside = exists && firstSample + row < samples;
      STATE(row, column) = toNumber(inside ? m.data.values[offset + (firstSample + row) * m.rowStride] : 0);
    }
  }
}

void forward(MlpForwardArguments a, uint firstSample, uint samples) {
  clearSums();
  for (uint first = 0; first < a.paddedInputs; first += kWidth) {
    const uint count = min(kWidth, a.paddedInputs - first);
    loadInput(a.inputs, firstSample, samples, first, count);
    accumulate(a.weights, first, 1, a.paddedInputs, count, kWidth);
  }

  uint offset = a.paddedInputs * kWidth;  // offset of the next layer's weights
  for (uint layer = 0; layer < a.hiddenLayers; ++layer) {
    storeSumsToState(true);
    if (IS_SET(a.activations)) {
      barrier();
      const uint base = (layer * a.samples.capacity + firstSample) * kWidth / 4;
      const uint rows = min(kBlock, samples - firstSample);
      for (uint i = gl_LocalInvocationIndex; i < rows * kWidth / 4; i += kThreads) {
        a.activations.values[base + i] = STATE_QUAD(i / (kWidth / 4), i % (kWidth / 4));
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
    outputSums(firstSample, first);
  }
}

void main() {
  const uint begin = rowRangeBegin(arguments.values.samples), samples = rowRangeEnd(arguments.values.samples);
  FOR_EACH_BLOCK(firstSample, begin, samples) forward(arguments.values, firstSample, samples);
}
