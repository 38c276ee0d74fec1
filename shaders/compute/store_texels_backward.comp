// StoreTexelsBackward: one invocation per feature. Rounding has a straight-through gradient.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_patches.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(StoreTexelsArguments)

const uint kFeatures = 8;

float storedGradient(StoreTexelsArguments a, uint row, uint column) {
  return a.stored.data.values[elementIndex(a.stored, row, column)];
}

void main() {
  StoreTexelsArguments a = arguments.values;
  FOR_EACH(i, rowRangeEnd(a.rows) * kFeatures) {
    const uint row = i / kFeatures, f = i % kFeatures;
    const float x = a.features.data.values[elementIndex(a.features, row, f)];
    const bool isInRange = a.ranges.values[2 * f] <= x && x <= a.ranges.values[2 * f + 1];
    float gradient = isInRange ? storedGradient(a, row, f) : 0;
    if (f == 0) {
      const float opacity = 1 / (1 + exp(-x - a.offset));
      gradient += storedGradient(a, row, kFeatures) * opacity * (1 - opacity);
    }
    a.featureGradients.data.values[elementIndex(a.featureGradients, row, f)] = gradient;
  }
}
