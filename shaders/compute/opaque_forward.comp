// OpaqueForward: one invocation per ray, front to back.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_composite.h"
#include "composite.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(OpaqueArguments)

void main() {
  OpaqueArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    float transmittance = 1;
    vec3 sum = vec3(0);
    const uint end = a.firstSample.values[ray + 1];
    for (uint i = a.firstSample.values[ray]; i < end && 1 - transmittance <= a.maxOpacity; ++i) {
      const float alpha = computeOpacity(kLogit, a.x.data.values[elementIndex(a.x, i, 0)] + a.offset, 0);
      if (!(alpha > a.threshold)) continue;
      for (uint c = 0; c < 3; ++c) {
        sum[c] += transmittance * alpha * a.colours.data.values[elementIndex(a.colours, i, c)];
      }
      transmittance *= 1 - alpha;
    }
    const float opacity = 1 - transmittance;
    const bool counts = opacity > 0 && opacity >= a.minOpacity;
    a.opacity.values[ray] = counts ? opacity : 0;
    for (uint c = 0; c < 3; ++c) a.colour.values[3 * ray + c] = counts ? sum[c] / opacity : 0;
  }
}
