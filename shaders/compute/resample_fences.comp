// ResampleFences: one invocation per ray, which walks along bins and new posts simultaneously, as both are sorted.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_proposals.h"
#include "real.glsl"

layout(local_size_x = 64) in;
KERNEL_ARGUMENTS(ResampleFencesArguments)

real annealed(float weight, float anneal) {
  if (anneal == 0) return 1;
  return anneal == 1 || weight == 0 ? weight : pow(weight, anneal);
}

void main() {
  ResampleFencesArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    const uint firstWeight = ray * a.before, firstPost = ray * (a.before + 1), firstNew = ray * (a.after + 1);
    real sum = 0;
    for (uint bin = 0; bin < a.before; ++bin) sum += annealed(a.weights.values[firstWeight + bin], a.anneal);
    const real jitter = IS_SET(a.jitter) ? a.jitter.values[ray] : 0.5;
    const real evenly = 1 / real(a.before);
    uint bin = 0, next = 0;
    real begin = 0, end = 0;  // the bin's range in the cumulative sum
    for (uint i = 1; i < a.after; ++i) {
      const real u = (i + jitter - real(0.5)) / a.after;
      for (; end <= u && next < a.before; ++next) {
        bin = next;
        begin = end;
        const real weight = annealed(a.weights.values[firstWeight + bin], a.anneal);
        const real share = sum > 0 ? (1 - a.uniformFraction) * weight / sum + a.uniformFraction * evenly : evenly;
        end = bin + 1 == a.before ? real(1) : min(real(1), begin + share);
      }
      const real from = a.fences.values[firstPost + bin], to = a.fences.values[firstPost + bin + 1];
      a.resampled.values[firstNew + i] = float(from + (u - begin) / (end - begin) * (to - from));
    }
    a.resampled.values[firstNew] = a.fences.values[firstPost];
    a.resampled.values[firstNew + a.after] = a.fences.values[firstPost + a.before];
  }
}
