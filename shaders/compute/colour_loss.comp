// ColourLoss: one invocation per channel of a ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_losses.h"
#include "group_sum.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(ColourLossArguments)

// Returns the value and the slope of the loss of a residual.
vec2 evaluateLoss(uint kind, float parameter, float r) {
  if (kind == 0) return vec2(r * r, 2 * r);
  if (kind == 1) {
    return abs(r) <= parameter ? vec2(r * r / (2 * parameter), r / parameter) : vec2(abs(r) - parameter / 2, sign(r));
  }
  const float root = sqrt(r * r + parameter * parameter);
  return vec2(root, root > 0 ? r / root : 0);
}

void main() {
  ColourLossArguments a = arguments.values;
  float loss = 0, squares = 0;
  FOR_EACH(i, 3 * rowRangeEnd(a.rays)) {
    const float weight = IS_SET(a.weights) ? a.weights.values[i / 3] : 1;
    const float r = a.predicted.values[i] - a.target.values[i];
    const vec2 f = evaluateLoss(a.kind, a.parameter, r);
    loss += weight * f.x;
    squares += weight * r * r;
    a.gradients.values[i] = a.scale * weight * f.y;
  }
  const float allLoss = groupSum(loss), allSquares = groupSum(squares);
  if (gl_LocalInvocationIndex != 0) return;
  a.partials.values[2 * gl_WorkGroupID.x] = a.scale * allLoss;
  a.partials.values[2 * gl_WorkGroupID.x + 1] = allSquares;
}
