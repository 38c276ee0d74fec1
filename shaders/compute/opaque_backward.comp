// OpaqueBackward: one invocation per ray. Instead of storing opacities, it computes them again from back to front: the
// transmittance in front of the last sample that counts is known after one pass, and that in front of each earlier one
// is its quotient by 1 - opacity. As rays end above maxOpacity, only the last sample's opacity can be close to 1, and its
// own transmittance is not divided.
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
    const uint first = a.firstSample.values[ray], end = a.firstSample.values[ray + 1];
    float after = 1, before = 1;  // transmittance behind and in front of the last sample that counts
    uint stop = first;
    for (uint i = first; i < end && 1 - after <= a.maxOpacity; ++i) {
      const float alpha = computeOpacity(kLogit, a.x.data.values[elementIndex(a.x, i, 0)] + a.offset, 0);
      if (!(alpha > a.threshold)) continue;
      before = after;
      after *= 1 - alpha;
      stop = i + 1;
    }
    const float opacity = 1 - after;
    if (!(opacity > 0 && opacity >= a.minOpacity)) continue;
    float rear = 0;
    bool isLast = true;
    for (uint i = stop; i-- > first;) {
      const float alpha = computeOpacity(kLogit, a.x.data.values[elementIndex(a.x, i, 0)] + a.offset, 0);
      if (!(alpha > a.threshold)) continue;
      if (!isLast) before /= 1 - alpha;
      isLast = false;
      float excess = 0;
      for (uint c = 0; c < 3; ++c) {
        const float g = a.rayColourGradients.values[3 * ray + c] / opacity;
        excess += g * (a.colours.data.values[elementIndex(a.colours, i, c)] - a.colour.values[3 * ray + c]);
        a.colourGradients.data.values[elementIndex(a.colourGradients, i, c)] += before * alpha * g;
      }
      a.xGradients.values[i] += before * (excess - rear) * alpha * (1 - alpha);
      rear = alpha * excess + (1 - alpha) * rear;
    }
  }
}
