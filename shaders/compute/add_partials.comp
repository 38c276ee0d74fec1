// One workgroup per column: adds up the partial sums of an earlier kernel's workgroups.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_scan.h"
#include "group_sum.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(AddPartialsArguments)

void main() {
  const uint columns = arguments.values.columns, column = gl_WorkGroupID.x;
  float sum = 0;
  for (uint i = gl_LocalInvocationIndex; i < arguments.values.count; i += 256) {
    sum += arguments.values.partials.values[i * columns + column];
  }
  const float all = groupSum(sum);
  if (gl_LocalInvocationIndex == 0) arguments.values.sums.values[column] = all;
}
