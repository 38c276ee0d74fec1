// S3imLoss: one invocation per channel of a group of 16 rays of a patch, which computes the SSIM and its gradient.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "float_sum.glsl"
#include "kernel.glsl"
#include "arguments_losses.h"
#include "group_sum.glsl"

layout(local_size_x = 256) in;
KERNEL_ARGUMENTS(S3imArguments)

const uint kGroup = 16;
const float kTaps[4] = float[](.136465, .265797, .331941, .265797);
const float kC1 = 1e-4, kC2 = 9e-4;

float windowWeight(uint p) { return kTaps[p / 4] * kTaps[p % 4]; }

// Returns 1 - SSIM, and adds -share times the gradient of the SSIM to the gradients.
float dissimilarity(S3imArguments a, uint first, uint channel, float share) {
  float x[kGroup], y[kGroup];
  uint counted = 0;  // bit mask of the rays that count
  float meanX = 0, meanY = 0;
  for (uint p = 0; p < kGroup; ++p) {
    const uint ray = a.orders.values[first + p];
    const bool counts = !IS_SET(a.weights) || a.weights.values[ray] != 0;
    counted |= uint(counts) << p;
    x[p] = a.predicted.values[3 * ray + channel];
    y[p] = counts ? a.target.values[3 * ray + channel] : x[p];
    meanX += windowWeight(p) * x[p];
    meanY += windowWeight(p) * y[p];
  }
  float squares = 0, products = 0;
  for (uint p = 0; p < kGroup; ++p) {
    const float fromX = x[p] - meanX, fromY = y[p] - meanY;
    squares += windowWeight(p) * (fromX * fromX + fromY * fromY);
    products += windowWeight(p) * fromX * fromY;
  }
  const float a1 = 2 * meanX * meanY + kC1, a2 = 2 * products + kC2;
  const float b1 = meanX * meanX + meanY * meanY + kC1, b2 = squares + kC2;
  const float similarity = a1 * a2 / (b1 * b2);
  for (uint p = 0; p < kGroup; ++p) {
    if ((counted >> p & 1) == 0) continue;
    const float slope = 2 * windowWeight(p) *
                        ((meanY * a2 + a1 * (y[p] - meanY)) / (b1 * b2) -
                         similarity * (meanX / b1 + (x[p] - meanX) / b2));
    addTo(a.gradients, 3 * a.orders.values[first + p] + channel, -share * slope);
  }
  return 1 - similarity;
}

void main() {
  S3imArguments a = arguments.values;
  const uint groups = rowRangeEnd(a.rays) / kGroup, perPatch = 3 * groups;
  const float share = groups > 0 && a.patches > 0 ? a.scale / (3.0 * float(a.patches) * float(groups)) : 0;
  float loss = 0;
  FOR_EACH(i, a.patches * perPatch) {
    const uint first = i / perPatch * a.rays.capacity + i % perPatch / 3 * kGroup;
    loss += dissimilarity(a, first, i % 3, share);
  }
  const float all = groupSum(loss);
  if (gl_LocalInvocationIndex == 0) a.partials.values[gl_WorkGroupID.x] = share * all;
}
