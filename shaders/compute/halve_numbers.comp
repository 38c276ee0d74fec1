// Converts floats to fp16.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "number.glsl"
#include "kernel.glsl"
#include "arguments_mlp.h"

layout(local_size_x = 128) in;
KERNEL_ARGUMENTS(HalveNumbersArguments)

void main() {
  HalveNumbersArguments a = arguments.values;
  FOR_EACH(i, a.count) a.halves.values[i] = toNumber(a.numbers.values[i]);
}
