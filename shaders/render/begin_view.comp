// One invocation a pixel: nothing has been met.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../compute/kernel.glsl"
#include "arguments_draw.h"
#include "../compute/vectors.glsl"
#include "view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
KERNEL_ARGUMENTS(ViewArguments)

void main() {
  ViewArguments view = arguments.values;
  uint pixel;
  if (!pixelIndex(view, pixel)) return;
  for (uint i = 0; i < kNumbersOfPixel; ++i) view.pixels.values[kNumbersOfPixel * pixel + i] = i == 3 ? 1 : 0;
}
