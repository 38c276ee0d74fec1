// Prefix sums over a workgroup's chunk of numbers: each invocation processes kRun consecutive numbers.
// Defines: kChunk, saturated(), countAt(), runningSum().
#include "arguments_scan.h"

const uint kThreads = 256;
const uint kRun = TESSERA_SCAN_CHUNK / kThreads;
const uint kChunk = TESSERA_SCAN_CHUNK;
layout(local_size_x = 256) in;
layout(constant_id = 0) const bool kCountsBits = false;  // sums the number of set bits of each word instead of the word
KERNEL_ARGUMENTS(ScanArguments)

shared uint sumOfThread[kThreads];

// Sums saturate at limit + 1, so that they cannot overflow.
uint saturated(uint sum) { return min(sum, arguments.values.limit + 1); }

uint countAt(uint index, uint end) {
  if (index >= end) return 0;
  const uint word = arguments.values.counts.values[index];
  return saturated(kCountsBits ? bitCount(word) : word);
}

// Returns the sum of `own` over the invocations before this one. All invocations must call it together. Afterwards,
// sumOfThread[kThreads - 1] is the total.
uint runningSum(uint own) {
  const uint thread = gl_LocalInvocationIndex;
  barrier();
  sumOfThread[thread] = own;
  for (uint distance = 1; distance < kThreads; distance *= 2) {
    barrier();
    const uint before = thread >= distance ? sumOfThread[thread - distance] : 0;
    barrier();
    sumOfThread[thread] = saturated(sumOfThread[thread] + before);
  }
  barrier();
  return thread == 0 ? 0 : sumOfThread[thread - 1];
}
