// The largest of an MLP's output gradients, one value per workgroup: the input of lossScale().
#version 460
#extension GL_GOOGLE_include_directive : require
#include "number.glsl"
#include "kernel.glsl"
#include "arguments_mlp.h"
#include "mlp_output_gradient.glsl"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(MlpLargestGradientArguments)

shared float largest[128];

void main() {
  MlpLargestGradientArguments a = arguments.values;
  float maximum = 0;
  FOR_EACH_ROW(row, a.last.samples) {
    for (uint column = 0; column < a.last.gradients.columns; ++column) {
      const float size = abs(outputGradient(a.last, row, column));
      maximum = max(maximum, isNoNumber(size) ? uintBitsToFloat(0x7f800000u) : size);
    }
  }
  largest[gl_LocalInvocationIndex] = maximum;
  for (uint other = 64; other > 0; other /= 2) {
    barrier();
    if (gl_LocalInvocationIndex < other) {
      largest[gl_LocalInvocationIndex] = max(largest[gl_LocalInvocationIndex], largest[gl_LocalInvocationIndex + other]);
    }
  }
  if (gl_LocalInvocationIndex == 0) a.largest.values[gl_WorkGroupID.x] = largest[0];
}
