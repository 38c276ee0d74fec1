// The order of the rays in each patch of S3imLoss: one workgroup per patch. A Fisher-Yates shuffle is one chain of
// exchanges, which one invocation executes, in shared memory if the rays fit; all invocations compute the random
// indices beforehand.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_losses.h"
#include "random.glsl"

layout(local_size_x = 256) in;
layout(constant_id = 0) const uint kWords = 7168;  // of two 16-bit ray indices each
KERNEL_ARGUMENTS(S3imArguments)

shared uint places[kWords];
shared uint others[gl_WorkGroupSize.x];

uint placeAt(uint i) { return bitfieldExtract(places[i / 2], int(i % 2 * 16), 16); }
void setPlace(uint i, uint place) { places[i / 2] = bitfieldInsert(places[i / 2], place, int(i % 2 * 16), 16); }

// Shuffles in device memory, if shared memory is too small for the rays.
void shuffle(S3imArguments a, uint first, uint rays, uvec2 key) {
  for (uint i = 0; i < rays; ++i) a.orders.values[first + i] = i;
  for (uint i = rays; i-- > 1;) {
    const uint other = randomBelow(key, i, i + 1), saved = a.orders.values[first + i];
    a.orders.values[first + i] = a.orders.values[first + other];
    a.orders.values[first + other] = saved;
  }
}

void shuffleShared(S3imArguments a, uint first, uint rays, uvec2 key) {
  const uint lane = gl_LocalInvocationIndex, lanes = gl_WorkGroupSize.x;
  for (uint word = lane; 2 * word < rays; word += lanes) places[word] = 2 * word | (2 * word + 1) << 16;
  for (uint left = rays; left > 1;) {
    const uint exchanges = min(left - 1, lanes);  // exchanges of the elements left - 1, left - 2, ...
    if (lane < exchanges) others[lane] = randomBelow(key, left - 1 - lane, left - lane);
    barrier();
    for (uint e = 0; lane == 0 && e < exchanges; ++e) {
      const uint i = left - 1 - e, saved = placeAt(i);
      setPlace(i, placeAt(others[e]));
      setPlace(others[e], saved);
    }
    barrier();
    left -= exchanges;
  }
  for (uint i = lane; i < rays; i += lanes) a.orders.values[first + i] = placeAt(i);
  barrier();
}

void main() {
  S3imArguments a = arguments.values;
  const uint rays = rowRangeEnd(a.rays), lane = gl_LocalInvocationIndex;
  for (uint number = gl_WorkGroupID.x; number < a.patches; number += gl_NumWorkGroups.x) {
    const uint first = number * a.rays.capacity;
    const uvec2 key = randomKey(add64(mix64(a.seed), uvec2(number, 0)), 0x531);
    if (number == 0) {  // in the original order
      for (uint i = lane; i < rays; i += gl_WorkGroupSize.x) a.orders.values[first + i] = i;
    } else if (rays <= 2 * kWords) {
      shuffleShared(a, first, rays, key);
    } else if (lane == 0) {
      shuffle(a, first, rays, key);
    }
  }
}
