// SparsityLoss: one invocation per point.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_losses.h"
#include "composite.glsl"
#include "group_sum.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(NumberLossArguments)

void main() {
  NumberLossArguments a = arguments.values;
  float loss = 0;
  FOR_EACH_ROW(i, a.numbers) {
    const float x = a.values.values[i], length = a.runtimeSteps.values[i], alpha = computeOpacity(kLogDensity, x, length);
    loss += alpha;
    a.gradients.values[i] = a.scale * (1 - alpha) * length * exp(clamp(x, -15, 15));
  }
  const float all = groupSum(loss);
  if (gl_LocalInvocationIndex == 0) a.partials.values[gl_WorkGroupID.x] = a.scale * all;
}
