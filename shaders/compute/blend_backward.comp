// BlendBackward: one invocation per ray, which computes transmittances front to back, then gradients back to front.
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
    const uint first = a.firstSegment.values[ray], end = a.firstSegment.values[ray + 1];
    float transmittance = 1;
    for (uint k = first; k < end; ++k) {
      a.transmittances.values[k] = transmittance;
      transmittance *= 1 - a.opacities.values[k];
    }
    const vec3 gradient = pointAt(a.colour, ray);
    float rear = IS_SET(a.opacity) ? -a.opacity.values[ray] : 0;  // derivative of the loss with respect to the light from behind
    for (uint k = end; k-- > first;) {
      const float alpha = a.opacities.values[k], gate = kLiteral ? 1 : alpha, reaching = a.transmittances.values[k];
      const vec3 diffuse =
          vec3(a.composited.values[7 * k], a.composited.values[7 * k + 1], a.composited.values[7 * k + 2]);
      const vec3 specular = pointAt(a.specular, k);
      for (uint c = 0; c < 7; ++c) a.compositedGradients.values[7 * k + c] = c < 3 ? reaching * gradient[min(c, 2)] : 0;
      storePoint(a.specularGradients, k, reaching * gate * gradient);
      a.opacityGradients.values[k] = reaching * ((kLiteral ? 0 : dot(gradient, specular)) - rear);
      rear = dot(gradient, diffuse + gate * specular) + (1 - alpha) * rear;
    }
  }
}
