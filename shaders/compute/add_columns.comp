// AddColumns: adds a matrix to another. One invocation per element.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_attention.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(AddColumnsArguments)

void main() {
  AddColumnsArguments a = arguments.values;
  FOR_EACH(i, rowRangeEnd(a.rows) * a.sums.columns) {
    const uint row = i / a.sums.columns, column = i % a.sums.columns;
    a.sums.data.values[elementIndex(a.sums, row, column)] += a.added.data.values[elementIndex(a.added, row, column)];
  }
}
