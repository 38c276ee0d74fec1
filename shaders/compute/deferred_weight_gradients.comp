// Weight gradients of DeferredBackward. A workgroup sums the gradients of one network over its share of the segments;
// each invocation sums a few parameters. The workgroup's x selects the share, its y the network.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_deferred.h"
#include "deferred.glsl"

const uint kThreads = 256;
const uint kShare = TESSERA_SEGMENTS_OF_SHARE;
const uint kOfThread = (kParameters + kThreads - 1) / kThreads;
layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(DeferredArguments)

// Returns the indices of the two factors of a parameter's gradient among a segment's numbers; the second is kNumbers
// for a bias, whose second factor is 1.
uvec2 gradientFactors(uint parameter) {
  const uint firstGradients = kInputs + 2 * kHidden, secondGradients = firstGradients + kHidden;
  const uint thirdGradients = secondGradients + kHidden;
  if (parameter < kInputs * kHidden) return uvec2(firstGradients + parameter / kInputs, parameter % kInputs);
  if (parameter < kSecond) return uvec2(firstGradients + parameter - kInputs * kHidden, kNumbers);
  const uint inSecond = parameter - kSecond;
  if (parameter < kThird - kHidden) {
    return uvec2(secondGradients + inSecond / kHidden, kInputs + inSecond % kHidden);
  }
  if (parameter < kThird) return uvec2(secondGradients + inSecond - kHidden * kHidden, kNumbers);
  const uint inThird = parameter - kThird;
  if (inThird < 3 * kHidden) {
    return uvec2(thirdGradients + inThird / kHidden, kInputs + kHidden + inThird % kHidden);
  }
  return uvec2(thirdGradients + inThird - 3 * kHidden, kNumbers);
}

void main() {
  DeferredArguments a = arguments.values;
  const uint network = gl_WorkGroupID.y, segments = rowRangeEnd(a.segments);
  uvec2 factors[kOfThread];
  float sums[kOfThread];
  [[unroll]] for (uint i = 0; i < kOfThread; ++i) {
    factors[i] = gradientFactors(min(gl_LocalInvocationIndex + i * kThreads, kParameters - 1));
    sums[i] = 0;
  }
  bool any = false;
  for (uint share = gl_WorkGroupID.x * kShare; share < segments; share += gl_NumWorkGroups.x * kShare) {
    for (uint segment = share; segment < min(share + kShare, segments); ++segment) {
      if (a.networkOfSegment.values[segment] != network) continue;
      any = true;
      const uint at = segment * kNumbers;
      [[unroll]] for (uint i = 0; i < kOfThread; ++i) {
        const float other = factors[i].y == kNumbers ? 1 : a.layers.values[at + factors[i].y];
        sums[i] += a.layers.values[at + factors[i].x] * other;
      }
    }
  }
  if (!any) return;
  [[unroll]] for (uint i = 0; i < kOfThread; ++i) {
    const uint parameter = gl_LocalInvocationIndex + i * kThreads;
    if (parameter < kParameters && sums[i] != 0) addTo(a.networkGradients, network * kParameters + parameter, sums[i]);
  }
}
