// ShadeForward: one invocation per channel of a ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_attention.h"

layout(local_size_x = 256) in;
layout(constant_id = 0) const bool kWhole = false;
KERNEL_ARGUMENTS(ShadeArguments)

void main() {
  ShadeArguments a = arguments.values;
  FOR_EACH(i, 3 * rowRangeEnd(a.rays)) {
    const uint ray = i / 3, channel = i % 3;
    const float sum = a.diffuse.data.values[elementIndex(a.diffuse, ray, channel)] +
                      a.specular.data.values[elementIndex(a.specular, ray, channel)];
    a.colour.values[i] = (kWhole ? 1 : a.opacity.values[ray]) / (1 + exp(-sum));
  }
}
