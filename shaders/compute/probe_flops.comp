// Measures multiply-adds on registers: sixteen independent chains of `rounds` each.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_probe.h"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(ProbeArguments)

void main() {
  ProbeArguments a = arguments.values;
  vec4 sums[4];
  const float seed = float(gl_GlobalInvocationID.x & 1023) * 1e-4;
  [[unroll]] for (int i = 0; i < 4; ++i) sums[i] = vec4(seed, seed + 0.1, seed + 0.2, seed + 0.3) + i;
  const vec4 factor = vec4(0.999 + seed * 1e-3), addend = vec4(seed * 1e-2);
  for (uint round = 0; round < a.rounds; ++round) {
    [[unroll]] for (int i = 0; i < 4; ++i) sums[i] = fma(sums[i], factor, addend);
  }
  const vec4 all = sums[0] + sums[1] + sums[2] + sums[3];
  const float sum = all.x + all.y + all.z + all.w;
  if (sum == 12345.678) a.to.values[0] = floatBitsToUint(sum);  // never true, which the compiler cannot know
}
