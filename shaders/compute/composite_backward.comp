// CompositeBackward: one invocation per ray, which computes opacities front to back, then gradients back to front with
// the derivative of the loss with respect to the light from behind (`rear`). It never divides by 1 - opacity.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "kernel.glsl"
#include "arguments_composite.h"
#include "composite.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint kColumns = 3;
KERNEL_ARGUMENTS(CompositeBackwardArguments)

// Stores the opacities and transmittances of the ray's samples up to early termination. Returns the end of these
// samples.
uint throughRay(CompositeBackwardArguments a, uint first, uint end) {
  float transmittance = 1;
  uint i = first;
  for (; i < end && transmittance >= a.minTransmittance; ++i) {
    const float length = usesSteps(a.extinction) ? a.steps.values[i] : 0;
    const float alpha = computeOpacity(a.extinction, a.x.data.values[elementIndex(a.x, i, 0)] + a.offset, length);
    a.opacities.values[2 * i] = alpha;
    a.opacities.values[2 * i + 1] = transmittance;
    transmittance *= 1 - alpha;
  }
  return i;
}

float slopeOfOpacity(CompositeBackwardArguments a, uint i, float alpha) {
  if (a.extinction == kOpacity) return 1;
  if (a.extinction == kLogit) return alpha * (1 - alpha);
  const float slope = (1 - alpha) * a.steps.values[i];
  return a.extinction == kDensity ? slope : slope * exp(clamp(a.x.data.values[elementIndex(a.x, i, 0)] + a.offset, -15, 15));
}

void backward(CompositeBackwardArguments a, uint ray) {
  const uint first = a.firstSample.values[ray], end = a.firstSample.values[ray + 1];
  const uint stop = throughRay(a, first, end);
  float gradient[kMaxColumns];
  float rear = IS_SET(a.rayOpacityGradients) ? -a.rayOpacityGradients.values[ray] : 0;  // opacity = 1 - T
  [[unroll]] for (uint c = 0; c < kColumns; ++c) {
    gradient[c] = a.rayColourGradients.values[kColumns * ray + c];
    if (IS_SET(a.background)) rear += gradient[c] * a.background.values[kColumns * ray + c];
  }
  for (uint i = stop; i-- > first;) {
    const float alpha = a.opacities.values[2 * i], reaching = a.opacities.values[2 * i + 1];
    float scale = 1;
    if (a.fullGradientDistance > 0) {
      const float nearness = a.distances.values[i] / a.fullGradientDistance;
      scale = min(1, nearness * nearness);
    }
    float worth = IS_SET(a.weightGradients) ? a.weightGradients.values[i] : 0;
    if (IS_SET(a.rayDepthGradients)) worth += a.rayDepthGradients.values[ray] * a.distances.values[i];
    [[unroll]] for (uint c = 0; c < kColumns; ++c) {
      worth += gradient[c] * a.colours.data.values[elementIndex(a.colours, i, c)];
      a.colourGradients.data.values[elementIndex(a.colourGradients, i, c)] = scale * reaching * alpha * gradient[c];
    }
    const float slope = scale * reaching * (worth - rear) * slopeOfOpacity(a, i, alpha);
    a.xGradients.values[i] = a.addToXGradients != 0 ? a.xGradients.values[i] + slope : slope;
    rear = alpha * worth + (1 - alpha) * rear;
  }
  for (uint i = stop; i < end; ++i) {
    if (a.addToXGradients == 0) a.xGradients.values[i] = 0;
    [[unroll]] for (uint c = 0; c < kColumns; ++c) {
      a.colourGradients.data.values[elementIndex(a.colourGradients, i, c)] = 0;
    }
  }
}

void main() {
  FOR_EACH_ROW(ray, arguments.values.rays) backward(arguments.values, ray);
}
