// One invocation per pixel: copies blended frames to the image of the view.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_mesh.h"
#include "../../compute/vectors.glsl"
#include "../../render/view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
KERNEL_ARGUMENTS(BlendFramesArguments)

void main() {
  BlendFramesArguments a = arguments.values;
  uint pixel;
  if (!pixelIndex(a.view, pixel)) return;
  const uint first = 5 * pixel;
  storePoint(a.view.colour, pixel,
             vec3(a.blended.values[first], a.blended.values[first + 1], a.blended.values[first + 2]));
  // The depth is that of the frame, premultiplied by the blended opacity.
  const float opacity = a.blended.values[first + 3];
  a.view.depth.values[pixel] *= opacity;
  a.view.opacity.values[pixel] = opacity;
}
