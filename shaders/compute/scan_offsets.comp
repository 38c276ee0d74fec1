// Second of three scan kernels, one workgroup: computes the sum before each chunk.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "scan.glsl"

void main() {
  uint before = 0;  // the sum of all previous iterations
  const uint count = arguments.values.partialCount;
  for (uint base = 0; base < count; base += kThreads) {
    const uint index = base + gl_LocalInvocationIndex;
    const uint own = index < count ? arguments.values.partials.values[index] : 0;
    const uint offset = saturated(before + runningSum(own));
    if (index < count) arguments.values.partials.values[index] = offset;
    before = saturated(before + sumOfThread[kThreads - 1]);
  }
  if (gl_LocalInvocationIndex == 0) {
    arguments.values.total.values[0] = 0;
    arguments.values.fitting.values[0] = 0;
  }
}
