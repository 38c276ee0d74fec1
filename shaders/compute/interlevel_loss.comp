// InterlevelLoss: one invocation per ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_losses.h"
#include "real.glsl"
#include "group_sum.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(RayLossArguments)

// Returns the number of fence posts at or before s, searching from a guess.
uint postsUpTo(RayLossArguments a, uint firstPost, real s, uint guess) {
  uint count = guess;
  while (count > 0 && a.fences.values[firstPost + count - 1] > s) --count;
  while (count <= a.intervals && a.fences.values[firstPost + count] <= s) ++count;
  return count;
}

float lossOfRay(RayLossArguments a, uint ray) {
  const uint firstPost = ray * (a.intervals + 1), firstBin = ray * a.intervals;
  for (uint bin = 0; bin < a.intervals; ++bin) a.gradients.values[firstBin + bin] = 0;
  float loss = 0;
  uint near = 0;
  for (uint i = a.firstSample.values[ray]; i < a.firstSample.values[ray + 1]; ++i) {
    const real middle = a.middles.values[i], radius = real(a.widths.values[i]) / 2;
    near = postsUpTo(a, firstPost, middle - radius, near);
    const uint first = clamp(near, 1, a.intervals) - 1;
    const uint end = clamp(postsUpTo(a, firstPost, middle + radius, near), first + 1, a.intervals);
    const float weight = a.sampleWeights.values[i];
    float bound = 0;
    for (uint bin = first; bin < end; ++bin) bound += a.weights.values[firstBin + bin];
    const float excess = max(0, weight - bound);
    if (excess == 0) continue;
    loss += excess * excess / (weight + 1e-7);
    const float slope = a.scale * 2 * excess / (weight + 1e-7);
    for (uint bin = first; bin < end; ++bin) a.gradients.values[firstBin + bin] -= slope;
  }
  return loss;
}

void main() {
  RayLossArguments a = arguments.values;
  float loss = 0;
  FOR_EACH_ROW(ray, a.rays) loss += lossOfRay(a, ray);
  const float all = groupSum(loss);
  if (gl_LocalInvocationIndex == 0) a.partials.values[gl_WorkGroupID.x] = a.scale * all;
}
