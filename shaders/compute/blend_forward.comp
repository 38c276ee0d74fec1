// BlendForward: one invocation per ray, front to back over its segments.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_deferred.h"
#include "vectors.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const bool kLiteral = false;
KERNEL_ARGUMENTS(BlendArguments)

void main() {
  BlendArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    vec3 colour = vec3(0);
    float transmittance = 1, depth = 0;
    for (uint k = a.firstSegment.values[ray]; k < a.firstSegment.values[ray + 1]; ++k) {
      const float alpha = a.opacities.values[k], gate = kLiteral ? 1 : alpha;
      const vec3 diffuse =
          vec3(a.composited.values[7 * k], a.composited.values[7 * k + 1], a.composited.values[7 * k + 2]);
      colour += transmittance * (diffuse + gate * pointAt(a.specular, k));
      depth += transmittance * a.depths.values[k];
      transmittance *= 1 - alpha;
    }
    storePoint(a.colour, ray, colour);
    a.opacity.values[ray] = 1 - transmittance;
    a.depth.values[ray] = depth;
  }
}
