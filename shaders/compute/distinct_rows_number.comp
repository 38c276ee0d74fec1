// Last kernel of DistinctRows: one invocation per id writes its row.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_patches.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(DistinctRowsArguments)

const uint kNoRow = 0xffffffffu;

void main() {
  DistinctRowsArguments a = arguments.values;
  FOR_EACH(i, rowRangeEnd(a.samples) * a.perSample) {
    const uint id = a.ids.values[i];
    uint row = kNoRow;
    if (id < a.idCount) {
      row = a.ranks.values[id / 32] + bitCount(a.marks.values[id / 32] & ((1u << id % 32) - 1));
      if (row >= a.rowCapacity) row = kNoRow;
    }
    a.rows.values[i] = row;
  }
}
