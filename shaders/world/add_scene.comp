// Blends a scene over the image of a world, and adds its surface to the depth. The scene's rays
// ended at that depth, so that all of it is in front.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../compute/kernel.glsl"
#include "arguments_world.h"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(AddSceneArguments)

void main() {
  AddSceneArguments a = arguments.values;
  FOR_EACH(pixel, a.image.pixels) {
    const float opacity = a.opacity.values[pixel], transmittance = 1 - opacity;
    for (uint c = 0; c < 3; ++c) {
      const uint number = 3 * pixel + c;
      a.image.colour.values[number] = a.colour.values[number] + transmittance * a.image.colour.values[number];
    }
    a.image.opacity.values[pixel] = opacity + transmittance * a.image.opacity.values[pixel];
    a.image.depth.values[pixel] = min(a.image.depth.values[pixel], a.surface.values[pixel]);
  }
}
