// DepthLoss: one invocation per ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_losses.h"
#include "group_sum.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(RayLossArguments)

void main() {
  RayLossArguments a = arguments.values;
  float loss = 0;
  FOR_EACH_ROW(ray, a.rays) {
    const float known = a.known.values[ray];
    if (!(known > 0)) continue;
    float near = 0;  // the weight of the samples near the known depth
    for (uint i = a.firstSample.values[ray]; i < a.firstSample.values[ray + 1]; ++i) {
      const float nearness = 1 - clamp(abs(a.distances.values[i] - known) / known - a.tolerance, 0, 1);
      near += a.weights.values[i] * nearness;
      a.gradients.values[i] -= a.scale * nearness;
    }
    loss += 1 - near;
  }
  const float all = groupSum(loss);
  if (gl_LocalInvocationIndex == 0) a.partials.values[gl_WorkGroupID.x] = a.scale * all;
}
