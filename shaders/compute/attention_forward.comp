// AttentionForward: one invocation per sample.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_attention.h"
#include "attention.glsl"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(AttentionArguments)

void main() {
  AttentionArguments a = arguments.values;
  FOR_EACH_ROW(row, a.samples) {
    float sums[kFeatures];
    [[unroll]] for (uint f = 0; f < kFeatures; ++f) sums[f] = a.coarse.data.values[elementIndex(a.coarse, row, f)];
    [[unroll]] for (uint l = 0; l < kLevels; ++l) {
      const float ofDensity = levelWeight(a, row, logitIndex(l, 0)), ofColours = levelWeight(a, row, logitIndex(l, 1));
      [[unroll]] for (uint f = 0; f < kFeatures; ++f) {
        sums[f] += (f == 0 ? ofDensity : ofColours) * a.fine.data.values[elementIndex(a.fine, row, kFeatures * l + f)];
      }
    }
    sums[0] = min(sums[0], kMaxDensity);
    [[unroll]] for (uint f = 0; f < kFeatures; ++f) a.features.data.values[elementIndex(a.features, row, f)] = sums[f];
  }
}
