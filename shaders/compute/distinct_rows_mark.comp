// First kernel of DistinctRows: one invocation per id sets its bit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_patches.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(DistinctRowsArguments)

void main() {
  DistinctRowsArguments a = arguments.values;
  FOR_EACH(i, rowRangeEnd(a.samples) * a.perSample) {
    const uint id = a.ids.values[i];
    if (id >= a.idCount) continue;
    const uint bit = 1u << id % 32;
    if ((a.marks.values[id / 32] & bit) == 0) atomicOr(a.marks.values[id / 32], bit);
  }
}
