// LatticeForward: one invocation per sample.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_virtual_grid.h"
#include "vectors.glsl"
#include "virtual_grid.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(LatticeArguments)

const uint kColumns = 16;

void main() {
  LatticeArguments a = arguments.values;
  FOR_EACH_ROW(index, a.samples) {
    const Places places = findPlaces(a.grid, pointAt(a.positions, index));
    const uint block = a.blockOfSample.values[index];
    vec4 sums[kColumns / 4];
    [[unroll]] for (uint q = 0; q < kColumns / 4; ++q) sums[q] = vec4(0);
    [[unroll]] for (uint k = 0; k < 8; ++k) {
      const Corner corner = cornerAt(a.grid, places, k);
      const uint row = texelRow(a.grid, a.marks, a.ranks, block, index, k, corner.texel);
      if (row >= a.texels.capacity) continue;
      [[unroll]] for (uint q = 0; q < kColumns / 4; ++q) {
        sums[q] += corner.weight * Vec4Pointer(a.values).values[kColumns / 4 * row + q];
      }
    }
    [[unroll]] for (uint c = 0; c < kColumns; ++c) a.mixed.data.values[elementIndex(a.mixed, index, c)] = sums[c / 4][c % 4];
  }
}
