#include "compute/composite.h"

#include <algorithm>
#include <cmath>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kRaysPerTask = 64;

float opacityOf(Extinction extinction, float x, float step) {
  switch (extinction) {
    case Extinction::opacity:
      return x;
    case Extinction::density:
      return -std::expm1(-x * step);
    case Extinction::logDensity:
      return -std::expm1(-std::exp(x) * step);
  }
  return 0;
}

}  // namespace

void run(Context& context, const CompositeForward& a) {
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const float* x = hostPointer(a.x.data);
  const float* steps = hostPointer(a.steps);
  const float* distances = hostPointer(a.distances);
  const float* colours = hostPointer(a.colours.data);
  const float* background = hostPointer(a.background);
  float* colour = hostPointer(a.colour);
  float* opacity = hostPointer(a.opacity);
  float* depth = hostPointer(a.depth);
  float* weights = hostPointer(a.weights);
  context.pool.forRanges(hostCount(a.rays), kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      float transmittance = 1, sum[3] = {0, 0, 0}, far = 0;
      const uint32_t last = firstSample[ray + 1];
      uint32_t i = firstSample[ray];
      for (; i < last; ++i) {
        const float alpha = opacityOf(a.extinction, x[a.x.offset(i, 0)], steps ? steps[i] : 0);
        const float weight = transmittance * alpha;
        const float* c = colours + a.colours.offset(i, 0);
        for (int k = 0; k < 3; ++k) sum[k] += weight * c[k];
        far += weight * distances[i];
        weights[i] = weight;
        transmittance *= 1 - alpha;
        if (transmittance < a.minTransmittance) {
          ++i;
          break;
        }
      }
      for (; i < last; ++i) weights[i] = 0;
      for (int k = 0; k < 3; ++k) {
        colour[3 * ray + k] = sum[k] + (background ? transmittance * background[3 * ray + k] : 0);
      }
      opacity[ray] = 1 - transmittance;
      depth[ray] = far;
    }
  });
}

void run(Context& context, const CompositeBackward& a) {
  const uint32_t* firstSample = hostPointer(a.firstSample);
  const float* x = hostPointer(a.x.data);
  const float* steps = hostPointer(a.steps);
  const float* distances = hostPointer(a.distances);
  const float* colours = hostPointer(a.colours.data);
  const float* background = hostPointer(a.background);
  const float* colourOfRay = hostPointer(a.rayColourGradients);
  const float* opacityOfRay = hostPointer(a.rayOpacityGradients);
  const float* depthOfRay = hostPointer(a.rayDepthGradients);
  const float* weightGradients = hostPointer(a.weightGradients);
  float* xGradients = hostPointer(a.xGradients);
  float* colourGradients = hostPointer(a.colourGradients.data);
  context.pool.forRanges(hostCount(a.rays), kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      const uint32_t first = firstSample[ray], last = firstSample[ray + 1];
      // Forward again: opacities, and the transmittance before each sample, kept where the gradients will go.
      uint32_t stop = first;
      float transmittance = 1;
      while (stop < last) {
        const float alpha = opacityOf(a.extinction, x[a.x.offset(stop, 0)], steps ? steps[stop] : 0);
        xGradients[stop] = alpha;
        colourGradients[a.colourGradients.offset(stop, 0)] = transmittance;
        transmittance *= 1 - alpha;
        ++stop;
        if (transmittance < a.minTransmittance) break;
      }
      const float* g = colourOfRay + 3 * ray;
      // R: what a unit of light arriving from behind would change the loss by; opacity = 1 - T.
      float rear = opacityOfRay ? -opacityOfRay[ray] : 0;
      if (background) {
        for (int k = 0; k < 3; ++k) rear += g[k] * background[3 * ray + k];
      }
      for (uint32_t i = stop; i-- > first;) {
        const float alpha = xGradients[i];
        float* dc = colourGradients + a.colourGradients.offset(i, 0);
        const float before = dc[0], weight = before * alpha;
        const float* c = colours + a.colours.offset(i, 0);
        float value = weightGradients ? weightGradients[i] : 0;
        if (depthOfRay) value += depthOfRay[ray] * distances[i];
        for (int k = 0; k < 3; ++k) {
          value += g[k] * c[k];
          dc[k] = weight * g[k];
        }
        const float perOpacity = before * (value - rear);  // ∂L/∂α
        rear = alpha * value + (1 - alpha) * rear;
        switch (a.extinction) {
          case Extinction::opacity:
            xGradients[i] = perOpacity;
            break;
          case Extinction::density:
            xGradients[i] = perOpacity * (1 - alpha) * steps[i];
            break;
          case Extinction::logDensity: {
            const float clamped = std::exp(std::clamp(x[a.x.offset(i, 0)], -15.0f, 15.0f));
            xGradients[i] = perOpacity * (1 - alpha) * steps[i] * clamped;
            break;
          }
        }
        if (a.fullGradientDistance > 0 && distances[i] < a.fullGradientDistance) {
          const float nearness = distances[i] / a.fullGradientDistance, scale = nearness * nearness;
          xGradients[i] *= scale;
          for (int k = 0; k < 3; ++k) dc[k] *= scale;
        }
      }
      for (uint32_t i = stop; i < last; ++i) {
        xGradients[i] = 0;
        float* dc = colourGradients + a.colourGradients.offset(i, 0);
        dc[0] = dc[1] = dc[2] = 0;
      }
    }
  });
}

}  // namespace tessera::cpu
