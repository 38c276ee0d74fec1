// One invocation an element.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_attention.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(AddColumnsArguments)

void main() {
  AddColumnsArguments a = arguments.values;
  FOR_EACH(i, endOf(a.rows) * a.sums.columns) {
    const uint row = i / a.sums.columns, column = i % a.sums.columns;
    a.sums.data.values[elementOf(a.sums, row, column)] += a.added.data.values[elementOf(a.added, row, column)];
  }
}
