// Measures products of cooperative matrices in registers: four independent chains of `rounds` each.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "number.glsl"
#include "kernel.glsl"
#include "arguments_probe.h"
#include "matrix_tiles.glsl"

KERNEL_ARGUMENTS(ProbeArguments)

shared float16_t numbers[256];
shared float staging[kSubgroups * 256];

void main() {
  ProbeArguments a = arguments.values;
  for (uint i = gl_LocalInvocationIndex; i < 256; i += kThreads) numbers[i] = toNumber(float(i) * 1e-5);
  barrier();
  TileA one;
  TileB other;
  LOAD_A(one, numbers, 0, kTileDepth, false);
  LOAD_B(other, numbers, 0, kTileColumns, false);
  TileSum sums[4];
  [[unroll]] for (uint i = 0; i < 4; ++i) { CLEAR_SUM(sums[i]); }
  for (uint round = 0; round < a.rounds; ++round) {
    [[unroll]] for (uint i = 0; i < 4; ++i) { MULTIPLY_ADD(sums[i], one, other); }
  }
  float sum = 0;
  [[unroll]] for (uint i = 0; i < 4; ++i) {
    subgroupWait();
    STORE_SUM(sums[i], staging, kSubgroup * 256, kTileColumns);
    subgroupWait();
    sum += staging[kSubgroup * 256 + kLane];
  }
  if (sum == 12345.678) a.to.values[0] = floatBitsToUint(sum);  // never true, which the compiler cannot know
}
