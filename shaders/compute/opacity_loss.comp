// OpacityLoss: one invocation per segment.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_losses.h"
#include "group_sum.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(NumberLossArguments)

// Returns ln(x), where rest = 1 - x, without loss of precision for small `rest`.
float accurateLog(float x, float rest) {
  return rest > 0.03 ? log(x) : -rest * (1 + rest * (0.5 + rest * (1.0 / 3 + rest * 0.25)));
}

void main() {
  NumberLossArguments a = arguments.values;
  float loss = 0;
  FOR_EACH_ROW(i, a.numbers) {
    const float opacity = a.values.values[i];
    const float alpha = clamp(opacity, 1e-5, 1 - 1e-5), rest = clamp(1 - opacity, 1e-5, 1 - 1e-5);
    const float logAlpha = accurateLog(alpha, rest), logRest = accurateLog(rest, alpha);
    loss -= alpha * logAlpha + rest * logRest;
    a.gradients.values[i] += a.scale * (logRest - logAlpha);
  }
  const float all = groupSum(loss);
  if (gl_LocalInvocationIndex == 0) a.partials.values[gl_WorkGroupID.x] = a.scale * all;
}
