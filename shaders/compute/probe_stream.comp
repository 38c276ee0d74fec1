// Copies `count` blocks of 16 bytes, `rounds` times, there and back.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_probe.h"

layout(local_size_x = 256) in;
layout(buffer_reference, std430, buffer_reference_align = 16) buffer BlocksPointer { uvec4 values[]; };
KERNEL_ARGUMENTS(ProbeArguments)

void main() {
  ProbeArguments a = arguments.values;
  BlocksPointer from = BlocksPointer(uvec2(a.from)), to = BlocksPointer(uvec2(a.to));
  for (uint round = 0; round < a.rounds; ++round) {
    // Each round adds something: none can be left out.
    if ((round & 1) == 0) {
      FOR_EACH(i, a.count) to.values[i] = from.values[i] + round;
    } else {
      FOR_EACH(i, a.count) from.values[i] = to.values[i] + round;
    }
  }
}
