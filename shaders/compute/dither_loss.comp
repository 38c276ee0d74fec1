// DitherLoss: one invocation per ray.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_losses.h"
#include "group_sum.glsl"
#include "vectors.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(DitherLossArguments)

// Returns the loss of the samples of a ray without the factor `scale`, and writes their gradients.
float lossOfSamples(DitherLossArguments a, uint ray, float scale) {
  float loss = 0;
  for (uint i = a.firstSample.values[ray]; i < a.firstSample.values[ray + 1]; ++i) {
    const float weight = a.weights.values[i];
    float square = 0;
    for (uint c = 0; c < 3; ++c) {
      const float value = a.colours.data.values[elementIndex(a.colours, i, c)];
      square += value * value;
      a.colourGradients.data.values[elementIndex(a.colourGradients, i, c)] += 2 * scale * weight * value;
    }
    loss += weight * square;
    a.weightGradients.values[i] = scale * square;
  }
  return loss;
}

// Returns the rest of the loss of a ray, and adds its gradients.
float lossOfRay(DitherLossArguments a, uint ray, float scale) {
  const vec3 colour = pointAt(a.colour, ray);
  storePoint(a.rayColourGradients, ray, pointAt(a.rayColourGradients, ray) - 2 * scale * colour);
  if (!IS_SET(a.background)) return -dot(colour, colour);
  const vec3 background = pointAt(a.background, ray);
  const float square = dot(background, background);
  a.rayOpacityGradients.values[ray] -= scale * square;
  return (1 - a.opacity.values[ray]) * square - dot(colour, colour);
}

void main() {
  DitherLossArguments a = arguments.values;
  float loss = 0;
  FOR_EACH_ROW(ray, a.rays) {
    const float rayWeight = IS_SET(a.rayWeights) ? a.rayWeights.values[ray] : 1, scale = a.scale * rayWeight;
    loss += rayWeight * (lossOfSamples(a, ray, scale) + lossOfRay(a, ray, scale));
  }
  const float all = groupSum(loss);
  if (gl_LocalInvocationIndex == 0) a.partials.values[gl_WorkGroupID.x] = a.scale * all;
}
