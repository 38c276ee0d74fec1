// Begins the image of a world with its models.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../compute/kernel.glsl"
#include "arguments_world.h"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(BeginWorldArguments)

void main() {
  BeginWorldArguments a = arguments.values;
  FOR_EACH(pixel, a.image.pixels) {
    vec3 colour = vec3(0);
    float depth = 0;
    if (IS_SET(a.modelDepths)) {
      depth = a.modelDepths.values[pixel];
      if (depth > 0) colour = unpackUnorm4x8(a.modelColours.values[pixel]).rgb;
    }
    for (uint c = 0; c < 3; ++c) a.image.colour.values[3 * pixel + c] = colour[c];
    a.image.opacity.values[pixel] = depth > 0 ? 1 : 0;
    a.image.depth.values[pixel] = depth > 0 ? depth : uintBitsToFloat(0x7f800000u);  // infinite
  }
}
