// Third of three scan kernels: computes the prefix sums, and how many of them are within the limit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "scan.glsl"

layout(constant_id = 1) const bool kExclusive = false;  // the sum before each number, excluding it

shared uint total, fitting;

void main() {
  if (gl_LocalInvocationIndex == 0) {
    total = 0;
    fitting = 0;
  }
  const uint end = rowRangeEnd(arguments.values.rows);
  for (uint chunk = gl_WorkGroupID.x; chunk < arguments.values.partialCount; chunk += gl_NumWorkGroups.x) {
    uint own = 0;
    const uint first = chunk * kChunk + gl_LocalInvocationIndex * kRun;
    for (uint i = first; i < first + kRun; ++i) own = saturated(own + countAt(i, end));
    uint sum = saturated(arguments.values.partials.values[chunk] + runningSum(own));
    uint largest = 0, fit = 0;
    for (uint i = first; i < min(first + kRun, end); ++i) {
      const uint before = sum;
      sum = saturated(sum + countAt(i, end));
      arguments.values.values.values[i] = kExclusive ? before : sum;
      if (sum <= arguments.values.limit) {
        largest = sum;
        fit = i + 1;
      }
    }
    atomicMax(total, largest);
    atomicMax(fitting, fit);
  }
  barrier();
  if (gl_LocalInvocationIndex == 0) {
    atomicMax(arguments.values.total.values[0], total);
    atomicMax(arguments.values.fitting.values[0], fitting);
  }
}
