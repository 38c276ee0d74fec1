// First of three scan kernels: computes the sum of each chunk.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "scan.glsl"

void main() {
  const uint end = rowRangeEnd(arguments.values.rows);
  for (uint chunk = gl_WorkGroupID.x; chunk < arguments.values.partialCount; chunk += gl_NumWorkGroups.x) {
    uint own = 0;
    const uint first = chunk * kChunk + gl_LocalInvocationIndex * kRun;
    for (uint i = first; i < first + kRun; ++i) own = saturated(own + countAt(i, end));
    runningSum(own);
    if (gl_LocalInvocationIndex == 0) arguments.values.partials.values[chunk] = sumOfThread[kThreads - 1];
  }
}
