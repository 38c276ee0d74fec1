// MlpBackward: gradients from the outputs back to the inputs for a block of samples, in shared memory. The gradients of
// each layer's sums are also written to memory for mlp_weight_gradients.comp. In fp16 all are scaled by lossScale().
#version 460
#extension GL_GOOGLE_include_directive : require
#include "number.glsl"
#include "kernel.glsl"
#include "arguments_mlp.h"
#include "mlp_block.glsl"
#include "mlp_output_gradient.glsl"

KERNEL_ARGUMENTS(MlpBackwardArguments)

float inputScale;  // the inverse of the scale

void storeSum(uint row, uint column, float sum) {
  MatrixArguments gradients = arguments.values.inputGradients;
  if (row >= rowRangeEnd(arguments.values.last.samples) || column >= gradients.columns) return;
  gradients.data.values[elementIndex(gradients, row, column)] = sum * inputScale;
}

// Sets `state` to the gradients of the output layer's sums.
void loadOutputGradients(MlpBackwardArguments a, float scale, uint firstSample, uint samples) {
  barrier();
  for (uint column = gl_LocalInvocationIndex % 16; column < a.paddedOutputs; column += 16) {
    Number gradients[kBlock * 16 / kThreads];  // all loads come before the first store, and so overlap
    [[unroll]] for (uint n = 0; n < kBlock * 16 / kThreads; ++n) {
      const uint index = firstSample + n * kThreads / 16 + gl_LocalInvocationIndex / 16;
      gradients[n] = toNumber(index < samples ? scale * outputGradient(a.last, index, column) : 0);
    }
    [[unroll]] for (uint n = 0; n < kBlock * 16 / kThreads; ++n) {
      const uint row = n * kThreads / 16 + gl_LocalInvocationIndex / 16, index = firstSample + row;
      if (index < samples) a.lastGradients.values[index * a.paddedOutputs + column] = gradients[n];
      STATE(row, column) = gradients[n];
    }
  }
}

void backward(MlpBackwardArguments a, float scale, uint firstSample, uint samples) {
  const uint rows = min(kBlock, samples - firstSample);

  loadOutputGradients(a, scale, firstSample, samples);
  uint depth = a.paddedOutputs;
  for (uint layer = a.hiddenLayers; layer > 0; --layer) {
    const uint offset = a.paddedInputs * kWidth + (layer - 1) * kWidth * kWidth;  // offset of this layer's weights
    clearSums();
    accumulate(a.weights, offset, kWidth, 1, depth, kWidth);
    storeSumsToState(false);
    barrier();
    const uint base = ((layer - 1) * a.last.samples.capacity + firstSample) * kWidth / 4;
    NumberQuad activations[kBlock * kWidth / 4 / kThreads];  // as above
    [[unroll]] for (uint n = 0; n < kBlock * kWidth / 4 / kThreads; ++n) {
      const uint i = n * kThreads + gl_LocalInvocationIndex;
      activations[n] = i < rows * kWidth / 4 ? a.activations.values[base + i] : NumberQuad(0);
    }
    [[unroll]] for (uint n = 0; n < kBlock * kWidth / 4 / kThreads; ++n) {
      const uint i = n * kThreads + gl_LocalInvocationIndex, row = i / (kWidth / 4), quad = i % (kWidth / 4);
      if (row >= rows) break;
      // The gradient is zero where ReLU was inactive.
      const NumberQuad gradient = mix(NumberQuad(0), STATE_QUAD(row, quad), greaterThan(activations[n], NumberQuad(0)));
      SET_STATE_QUAD(row, quad, gradient);
      a.hiddenGradients.values[base + i] = gradient;
    }
    depth = kWidth;
  }

  if (!IS_SET(a.inputGradients.data)) return;
  for (uint first = 0; first < a.inputGradients.columns; first += kWidth) {
    clearSums();
    accumulate(a.weights, first, a.paddedInputs, 1, kWidth, min(kWidth, a.paddedInputs - first));
    outputSums(firstSample, first);
  }
}

void main() {
  CountArguments count = arguments.values.last.samples;
  const uint begin = rowRangeBegin(count), samples = rowRangeEnd(count);
  if (begin + gl_WorkGroupID.x * kBlock >= samples) return;
  const float scale = lossScale(arguments.values.largest, arguments.values.largestCount);
  inputScale = 1 / scale;
  FOR_EACH_BLOCK(firstSample, begin, samples) backward(arguments.values, scale, firstSample, samples);
}
