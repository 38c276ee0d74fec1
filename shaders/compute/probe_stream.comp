// Measures streaming: copies `count` blocks of 16 bytes.
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
  FOR_EACH(i, a.count) to.values[i] = from.values[i];
}
