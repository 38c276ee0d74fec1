// Last kernel of OccupancyUpdate: one invocation per word of the occupancy bits.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_rays.h"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(OccupancyUpdateArguments)

void main() {
  OccupancyUpdateArguments a = arguments.values;
  const float threshold = min(a.threshold, a.sums.values[0] / max(a.sums.values[1], 1));
  FOR_EACH(word, a.cellCount / 32) {
    uint bits = 0;
    for (uint bit = 0; bit < 32; ++bit) bits |= uint(a.grid.values[32 * word + bit] > threshold) << bit;
    a.occupancy.values[word] = bits;
  }
}
