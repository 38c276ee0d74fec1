// AttentionBackward: one invocation per sample. Gradients of logits that do not vary are first summed over the
// workgroup.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_attention.h"
#include "attention.glsl"
#include "group_sum.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(AttentionArguments)

void main() {
  AttentionArguments a = arguments.values;
  float sums[2 * kLevels];  // of this invocation's samples
  [[unroll]] for (uint i = 0; i < 2 * kLevels; ++i) sums[i] = 0;
  FOR_EACH_ROW(row, a.samples) {
    float gradient[kFeatures];
    gradient[0] = a.logDensityGradients.values[row];
    [[unroll]] for (uint f = 1; f < kFeatures; ++f) {
      gradient[f] = a.colourGradients.data.values[elementIndex(a.colourGradients, row, f - 1)];
    }
    float slopes[2 * kLevels];
    [[unroll]] for (uint i = 0; i < 2 * kLevels; ++i) slopes[i] = 0;
    [[unroll]] for (uint l = 0; l < kLevels; ++l) {
      const float ofDensity = levelWeight(a, row, logitIndex(l, 0)), ofColours = levelWeight(a, row, logitIndex(l, 1));
      [[unroll]] for (uint f = 0; f < kFeatures; ++f) {
        const float weight = f == 0 ? ofDensity : ofColours;
        const float fine = a.fine.data.values[elementIndex(a.fine, row, kFeatures * l + f)];
        a.fineGradients.data.values[elementIndex(a.fineGradients, row, kFeatures * l + f)] = weight * gradient[f];
        if (kWeights != kNone) slopes[logitIndex(l, f)] += gradient[f] * fine * weight * (1 - weight);
      }
    }
    [[unroll]] for (uint f = 0; f < 2 * kFeatures; ++f) {
      const uint logit = f - kFeatures;
      float value = 0;
      if (f < kFeatures) value = gradient[f];
      else if (kVaries && logit < logitCount()) value = slopes[logit];
      a.coarseGradients.data.values[elementIndex(a.coarseGradients, row, f)] = value;
    }
    [[unroll]] for (uint i = 0; i < 2 * kLevels; ++i) sums[i] += slopes[i];
  }
  if (kVaries) return;
  for (uint i = 0; i < logitCount(); ++i) {
    const float all = groupSum(sums[i]);
    if (gl_LocalInvocationIndex == 0) addTo(a.logitGradients, i, all);
  }
}
