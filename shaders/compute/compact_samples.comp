// CompactSamples: one invocation per ray. Like march_rays.comp, the kernel runs twice: it counts the samples to keep,
// then writes them. A ray that is still transparent and has not left the space counts as one that does not fit.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_rays.h"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kWrite = false;
KERNEL_ARGUMENTS(CompactSamplesArguments)

const uint kThrough = 0xffffffffu;

uint countKept(CompactSamplesArguments a, uint ray) {
  float opticalDepth = 0;
  uint count = 0;
  for (uint q = 0; q < a.rounds; ++q) {
    const uint at = q * (a.rays.capacity + 1) + ray;
    for (uint i = a.firstSample.values[at]; i < a.firstSample.values[at + 1]; ++i) {
      const uint row = q * a.sampleCapacity + i;
      opticalDepth += exp(a.logDensity.data.values[elementIndex(a.logDensity, row, 0)]) * a.steps.values[row];
      ++count;
      if (opticalDepth > a.maxOpticalDepth) return count;
    }
  }
  const bool through = !IS_SET(a.nextStep) || a.nextStep.values[ray] == kThrough;
  return through ? count : a.keptCapacity + 1;
}

void write(CompactSamplesArguments a, uint ray, uint first, uint end) {
  uint next = first;
  for (uint q = 0; q < a.rounds && next < end; ++q) {
    const uint at = q * (a.rays.capacity + 1) + ray;
    for (uint i = a.firstSample.values[at]; i < a.firstSample.values[at + 1] && next < end; ++i, ++next) {
      a.source.values[next] = q * a.sampleCapacity + i;
      a.rayOfSample.values[next] = ray;
    }
  }
}

void main() {
  CompactSamplesArguments a = arguments.values;
  if (!kWrite) {
    FOR_EACH_ROW(ray, a.rays) a.counts.values[ray] = countKept(a, ray);
    return;
  }
  const uint fitting = a.fitting.values[0];
  if (gl_GlobalInvocationID.x == 0) {
    a.keptFirstSample.values[0] = 0;
    if (IS_SET(a.finishedRays)) a.finishedRays.values[0] = fitting;
  }
  FOR_EACH_ROW(ray, a.rays) {
    const bool fits = ray < fitting;
    const uint first = ray == 0 ? 0 : a.counts.values[ray - 1], end = a.counts.values[ray];
    a.keptFirstSample.values[ray + 1] = fits ? end : a.keptCount.values[0];
    if (fits) write(a, ray, first, end);
  }
}
