// Third kernel of OccupancyUpdate: the sum and the number of non-negative cells, one pair per workgroup.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_rays.h"
#include "group_sum.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(OccupancyUpdateArguments)

void main() {
  float sum = 0, count = 0;
  FOR_EACH(cell, arguments.values.cellCount) {
    const float value = arguments.values.grid.values[cell];
    sum += max(value, 0);
    count += value >= 0 ? 1 : 0;
  }
  const float allSum = groupSum(sum), allCount = groupSum(count);
  if (gl_LocalInvocationIndex != 0) return;
  arguments.values.partials.values[2 * gl_WorkGroupID.x] = allSum;
  arguments.values.partials.values[2 * gl_WorkGroupID.x + 1] = allCount;
}
