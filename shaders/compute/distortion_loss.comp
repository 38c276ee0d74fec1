// DistortionLoss: one invocation per ray, with two passes over its samples: one for the total sums, one for the sums
// before and behind each sample.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_losses.h"
#include "group_sum.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(RayLossArguments)

// MERF's warp of distance from t to s.
float warped(float t) { return t < 1 ? t / 2 : 1 - 1 / (2 * t); }

// Returns the interval of sample i in s.
vec2 sampleInterval(RayLossArguments a, uint i) {
  const float t = a.distances.values[i], radius = a.steps.values[i] / 2;
  const vec2 ends = vec2(t - radius, t + radius);
  return a.normalised != 0 ? ends : vec2(warped(ends.x), warped(ends.y));
}

float lossOfRay(RayLossArguments a, uint first, uint end) {
  if (first == end) return 0;
  const float origin = sampleInterval(a, first).x;  // sums of small numbers are more precise
  float weights = 0, moments = 0;
  for (uint i = first; i < end; ++i) {
    const vec2 interval = sampleInterval(a, i);
    weights += a.weights.values[i];
    moments += a.weights.values[i] * ((interval.x + interval.y) / 2 - origin);
  }
  float loss = 0, weightsBefore = 0, momentsBefore = 0;
  for (uint i = first; i < end; ++i) {
    const vec2 interval = sampleInterval(a, i);
    const float w = a.weights.values[i], s = (interval.x + interval.y) / 2 - origin, width = interval.y - interval.x;
    const float weightsBehind = weights - weightsBefore - w, momentsBehind = moments - momentsBefore - w * s;
    const float apart = s * weightsBefore - momentsBefore + (momentsBehind - s * weightsBehind);
    loss += w * (apart + w * width / 3);
    a.gradients.values[i] = a.scale * 2 * (apart + w * width / 3);
    weightsBefore += w;
    momentsBefore += w * s;
  }
  return loss;
}

void main() {
  RayLossArguments a = arguments.values;
  float loss = 0;
  FOR_EACH_ROW(ray, a.rays) loss += lossOfRay(a, a.firstSample.values[ray], a.firstSample.values[ray + 1]);
  const float all = groupSum(loss);
  if (gl_LocalInvocationIndex == 0) a.partials.values[gl_WorkGroupID.x] = a.scale * all;
}
