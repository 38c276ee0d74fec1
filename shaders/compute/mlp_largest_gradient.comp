// The largest of an MLP's output gradients, one value per workgroup: the input of lossScale().
#version 460
#extension GL_GOOGLE_include_directive : require
#include "number.glsl"
#include "kernel.glsl"
#include "arguments_mlp.h"

const uint kThreads = 128;
layout(local_size_x = 128) in;
#include "mlp_output_gradient.glsl"
KERNEL_ARGUMENTS(MlpLargestGradientArguments)

void main() {
  MlpLargestGradientArguments a = arguments.values;
  float maximum = 0;
  FOR_EACH_ROW(row, a.last.samples) {
    for (uint column = 0; column < a.last.gradients.columns; ++column) {
      const float size = abs(outputGradient(a.last, row, column));
      maximum = max(maximum, isNoNumber(size) ? uintBitsToFloat(0x7f800000u) : size);
    }
  }
  maximum = groupMaximum(maximum);
  if (gl_LocalInvocationIndex == 0) a.largest.values[gl_WorkGroupID.x] = maximum;
}
