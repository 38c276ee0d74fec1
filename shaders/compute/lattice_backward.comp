// LatticeBackward: one invocation per sample.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_virtual_grid.h"
#include "vectors.glsl"
#include "virtual_grid.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(LatticeArguments)

const uint kColumns = 16;

void main() {
  LatticeArguments a = arguments.values;
  const uint rows = rowRangeEnd(a.texels);
  FOR_EACH_ROW(index, a.samples) {
    const Places places = findPlaces(a.grid, pointAt(a.positions, index));
    const uint block = a.blockOfSample.values[index];
    float gradient[kColumns];
    [[unroll]] for (uint c = 0; c < kColumns; ++c) gradient[c] = a.mixed.data.values[elementIndex(a.mixed, index, c)];
    [[unroll]] for (uint k = 0; k < 8; ++k) {
      const Corner corner = cornerAt(a.grid, places, k);
      const uint row = texelRow(a.grid, a.marks, a.ranks, block, index, k, corner.texel);
      if (row >= rows || corner.weight == 0) continue;
      [[unroll]] for (uint c = 0; c < kColumns; ++c) {
        if (gradient[c] != 0) addTo(a.valueGradients, kColumns * row + c, corner.weight * gradient[c]);
      }
    }
  }
}
