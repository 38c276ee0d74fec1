// Last kernel of DistinctTexels: one invocation per word of marks writes the positions of its texels.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_virtual_grid.h"
#include "vectors.glsl"
#include "virtual_grid.glsl"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(DistinctTexelsArguments)

void main() {
  DistinctTexelsArguments a = arguments.values;
  FOR_EACH(word, a.blocks * a.grid.words) {
    uint bits = a.marks.values[word], row = a.ranks.values[word];
    const uint inBlock = word % a.grid.words;
    if (inBlock == 0) a.firstTexel.values[word / a.grid.words] = row;
    for (; bits != 0 && row < a.texelCapacity; bits &= bits - 1, ++row) {
      storePoint(a.texelPositions, row, texelPosition(a.grid, 32 * inBlock + findLSB(bits)));
    }
  }
}
