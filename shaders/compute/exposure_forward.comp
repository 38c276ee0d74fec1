// ExposureForward: one invocation per channel of a ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_losses.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(ExposureArguments)

void main() {
  ExposureArguments a = arguments.values;
  FOR_EACH(i, 3 * rowRangeEnd(a.rays)) {
    const uint ray = i / 3;
    float value = a.colours.values[i] * exp2(a.logGains.values[3 * a.photoOfRay.values[ray] + i % 3]);
    if (IS_SET(a.background)) value += (1 - a.opacity.values[ray]) * a.background.values[i];
    a.exposed.values[i] = value;
  }
}
