// Measures random loads of 8 bytes from a table of `count` entries, a power of two: `rounds` of eight independent
// loads.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_probe.h"

layout(local_size_x = 256) in;
layout(buffer_reference, std430, buffer_reference_align = 8) buffer EntriesPointer { uvec2 values[]; };
KERNEL_ARGUMENTS(ProbeArguments)

void main() {
  ProbeArguments a = arguments.values;
  EntriesPointer table = EntriesPointer(uvec2(a.from));
  uint state = gl_GlobalInvocationID.x * 747796405u + 2891336453u;
  uvec2 sum = uvec2(0);
  for (uint round = 0; round < a.rounds; ++round) {
    uvec2 loaded[8];
    [[unroll]] for (int i = 0; i < 8; ++i) {
      // PCG random numbers: neighbouring invocations load unrelated entries.
      state = state * 747796405u + 2891336453u;
      const uint word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737u;
      loaded[i] = table.values[((word >> 22) ^ word) & (a.count - 1)];
    }
    [[unroll]] for (int i = 0; i < 8; ++i) sum += loaded[i];
  }
  if (sum.x == 0xdeadbeef && sum.y == 0xbeefdead) a.to.values[0] = sum.x;  // never true
}
