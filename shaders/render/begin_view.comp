// Initialises the sums of each pixel; one invocation per pixel. The numbers of a pixel are its transmittance and the
// depth along its ray, followed by the premultiplied colour (`volume`), or by the sums of diffuse colour and features
// and the weight of each network (`hash`).
#version 460
#extension GL_GOOGLE_include_directive : require
#include "../compute/kernel.glsl"
#include "arguments_view.h"
#include "../compute/vectors.glsl"
#include "view.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
KERNEL_ARGUMENTS(ViewArguments)

void main() {
  ViewArguments view = arguments.values;
  uint pixel;
  if (!pixelIndex(view, pixel)) return;
  for (uint i = 0; i < view.numbersOfPixel; ++i) view.pixels.values[view.numbersOfPixel * pixel + i] = i == 0 ? 1 : 0;
  if (IS_SET(view.surface)) view.surface.values[pixel] = uintBitsToFloat(0x7f800000u);  // infinite
}
