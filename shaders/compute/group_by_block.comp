// GroupByBlock: one invocation per share of the rows. The kernel runs twice: it counts the rows of each block, and
// after their prefix sums are known, writes the rows in order.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_blocks.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kWrite = false;
KERNEL_ARGUMENTS(GroupByBlockArguments)

const uint kShare = TESSERA_ROWS_OF_SHARE;

void main() {
  GroupByBlockArguments a = arguments.values;
  const uint rows = rowRangeEnd(a.samples);
  if (kWrite) {
    FOR_EACH(block, a.blocks + 1) {
      a.firstOfBlock.values[block] = block == 0 ? 0 : a.counts.values[block * a.shares - 1];
    }
  }
  FOR_EACH(share, a.shares) {
    const uint first = share * kShare, end = min(first + kShare, rows);
    for (uint row = first; row < end; ++row) {
      const uint at = a.blockOfSample.values[row] * a.shares + share;
      if (!kWrite) {
        ++a.counts.values[at];
        continue;
      }
      // The prefix sum gives the first row of this share; the number of earlier rows gives the position of this one.
      uint before = 0;
      for (uint other = first; other < row; ++other) {
        before += uint(a.blockOfSample.values[other] == a.blockOfSample.values[row]);
      }
      a.source.values[(at == 0 ? 0 : a.counts.values[at - 1]) + before] = row;
    }
  }
}
