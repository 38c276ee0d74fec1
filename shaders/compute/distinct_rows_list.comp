// DistinctRows, after the ranks of words are known: one invocation per word of marks lists its ids.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_patches.h"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(DistinctRowsArguments)

void main() {
  DistinctRowsArguments a = arguments.values;
  FOR_EACH(word, a.words) {
    uint bits = a.marks.values[word], row = a.ranks.values[word];
    for (; bits != 0 && row < a.rowCapacity; bits &= bits - 1, ++row) {
      a.rowIds.values[row] = 32 * word + findLSB(bits);
    }
  }
}
