// Writes the RenderedView from the sums of `volume` contents; one invocation per pixel.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../../compute/kernel.glsl"
#include "arguments_volume.h"
#include "../../compute/vectors.glsl"
#include "../../render/view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
KERNEL_ARGUMENTS(ViewArguments)

void main() {
  ViewArguments view = arguments.values;
  uint pixel;
  if (!pixelIndex(view, pixel)) return;
  const uint first = view.numbersOfPixel * pixel;
  for (uint c = 0; c < 3; ++c) view.colour.values[3 * pixel + c] = view.pixels.values[first + 2 + c];
  view.opacity.values[pixel] = 1 - view.pixels.values[first];
  view.depth.values[pixel] = view.pixels.values[first + 1] * view.directions.values[3 * pixel + 2] * view.scale;
}
