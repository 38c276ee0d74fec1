// Counts workgroups for rows that only the device counts: at least one, as some kernels do more than process rows.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_groups.h"

layout(local_size_x = 1) in;

KERNEL_ARGUMENTS(CountGroupsArguments)

void main() {
  CountGroupsArguments a = arguments.values;
  const uint first = rowRangeBegin(a.rows), end = rowRangeEnd(a.rows);
  const uint elements = end > first ? (end - first) * a.elements : 0;
  a.groups.values[0] = clamp(elements / a.perGroup + uint(elements % a.perGroup != 0), 1, a.maximum);
  a.groups.values[1] = a.y;
  a.groups.values[2] = 1;
}
