// First kernel of OccupancyUpdate: decays every cell.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_rays.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(OccupancyUpdateArguments)

void main() {
  FOR_EACH(cell, arguments.values.cellCount) {
    const float value = arguments.values.grid.values[cell];
    if (value > 0) arguments.values.grid.values[cell] = value * arguments.values.decay;
  }
}
