// Zeroes rows: one invocation per number.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_virtual_grid.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(ZeroRowsArguments)

void main() {
  FOR_EACH(i, rowRangeEnd(arguments.values.rows) * arguments.values.columns) arguments.values.numbers.values[i] = 0;
}
