// StoreTexelsForward: one invocation per stored number.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_patches.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(StoreTexelsArguments)

const uint kFeatures = 8, kStored = kFeatures + 1;

float roundToByte(float x) { return floor(255 * x + 0.5) / 255; }

float storedFeature(float x, float low, float high) {
  if (!(high > low)) return low;
  return low + (high - low) * roundToByte((clamp(x, low, high) - low) / (high - low));
}

float storedOpacity(StoreTexelsArguments a, float logit) {
  const float opacity = 1 / (1 + exp(-logit - a.offset));
  if (opacity >= a.opaqueFrom) return 1;
  return opacity < a.transparentBelow ? 0 : roundToByte(opacity);
}

void main() {
  StoreTexelsArguments a = arguments.values;
  FOR_EACH(i, rowRangeEnd(a.rows) * kStored) {
    const uint row = i / kStored, column = i % kStored, feature = column == kFeatures ? 0 : column;
    const float x = a.features.data.values[elementIndex(a.features, row, feature)];
    a.stored.data.values[elementIndex(a.stored, row, column)] =
        column == kFeatures ? storedOpacity(a, x)
                            : storedFeature(x, a.ranges.values[2 * column], a.ranges.values[2 * column + 1]);
  }
}
