// Running sums over a workgroup's chunk of numbers: each invocation takes kRun of them in order.
// Defines: kChunk, saturated(), countAt(), runningSum().
#include "arguments_scan.h"

const uint kThreads = 256;
const uint kRun = TESSERA_SCAN_CHUNK / kThreads;
const uint kChunk = TESSERA_SCAN_CHUNK;
layout(local_size_x = 256) in;
layout(constant_id = 0) const bool kCountsBits = false;  // of words instead of words themselves
KERNEL_ARGUMENTS(ScanArguments)

shared uint sumOfThread[kThreads];

// Sums that are too large stay so: there is no overflow.
uint saturated(uint sum) { return min(sum, arguments.values.limit + 1); }

uint countAt(uint index, uint end) {
  if (index >= end) return 0;
  const uint word = arguments.values.counts.values[index];
  return saturated(kCountsBits ? bitCount(word) : word);
}

// → Σ of `own` over the invocations before this one; all call it together. sumOfThread[kThreads - 1] is that of all.
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
