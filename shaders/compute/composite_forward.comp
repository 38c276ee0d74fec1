// CompositeForward: one invocation per ray, front to back.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_composite.h"
#include "composite.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kColumns = 3;
KERNEL_ARGUMENTS(CompositeForwardArguments)

void main() {
  CompositeForwardArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    float transmittance = 1, depth = 0;
    float sum[kMaxColumns];
    [[unroll]] for (uint c = 0; c < kColumns; ++c) sum[c] = 0;
    const uint end = a.firstSample.values[ray + 1];
    for (uint i = a.firstSample.values[ray]; i < end; ++i) {
      float weight = 0;  // after early termination
      if (transmittance >= a.minTransmittance) {
        const float length = usesSteps(a.extinction) ? a.steps.values[i] : 0;
        const float alpha = computeOpacity(a.extinction, a.x.data.values[elementIndex(a.x, i, 0)] + a.offset, length);
        weight = transmittance * alpha;
        [[unroll]] for (uint c = 0; c < kColumns; ++c) {
          sum[c] += weight * a.colours.data.values[elementIndex(a.colours, i, c)];
        }
        if (IS_SET(a.depth)) depth += weight * a.distances.values[i];
        transmittance *= 1 - alpha;
      }
      a.weights.values[i] = weight;
    }
    [[unroll]] for (uint c = 0; c < kColumns; ++c) {
      const uint at = kColumns * ray + c;
      a.colour.values[at] = IS_SET(a.background) ? sum[c] + transmittance * a.background.values[at] : sum[c];
    }
    a.opacity.values[ray] = 1 - transmittance;
    if (IS_SET(a.depth)) a.depth.values[ray] = depth;
  }
}
