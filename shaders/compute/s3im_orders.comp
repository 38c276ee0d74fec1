// One invocation a patch: the order in which it takes the rays. A Fisher-Yates shuffle is one long chain.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_losses.h"
#include "random.glsl"

layout(local_size_x = 1) in;
KERNEL_ARGUMENTS(S3imArguments)

void main() {
  S3imArguments a = arguments.values;
  const uint rays = endOf(a.rays);
  FOR_EACH(number, a.patches) {
    const uint first = number * a.rays.capacity;
    for (uint i = 0; i < rays; ++i) a.orders.values[first + i] = i;
    if (number == 0) continue;
    const uvec2 key = randomKey(add64(mix64(a.seed), uvec2(number, 0)), 0x531);
    for (uint i = rays; i-- > 1;) {
      const uint other = randomBelow(key, i, i + 1), kept = a.orders.values[first + i];
      a.orders.values[first + i] = a.orders.values[first + other];
      a.orders.values[first + other] = kept;
    }
  }
}
