// ShadeBackward: one invocation per ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_attention.h"

layout(local_size_x = 128) in;
layout(constant_id = 0) const bool kWhole = false;
KERNEL_ARGUMENTS(ShadeArguments)

void main() {
  ShadeArguments a = arguments.values;
  FOR_EACH_ROW(ray, a.rays) {
    const float gate = kWhole ? 1 : a.opacity.values[ray];
    float ofOpacity = 0;
    for (uint c = 0; c < 3; ++c) {
      const float sum = a.diffuse.data.values[elementIndex(a.diffuse, ray, c)] +
                        a.specular.data.values[elementIndex(a.specular, ray, c)];
      const float y = 1 / (1 + exp(-sum)), gradient = a.colour.values[3 * ray + c];
      ofOpacity += gradient * y;
      a.sumGradients.data.values[elementIndex(a.sumGradients, ray, c)] = gradient * gate * y * (1 - y);
    }
    if (!kWhole) a.opacityGradients.values[ray] += ofOpacity;
  }
}
