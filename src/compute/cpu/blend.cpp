#include "compute/blend.h"

#include <algorithm>

#include "compute/cpu/kernels.h"
#include "compute/deferred.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

constexpr size_t kRaysPerTask = 256;
constexpr int kComposited = DeferredNetwork::kComposited;

}  // namespace

void run(Context& context, const BlendForward& a) {
  const uint32_t* firstSegment = hostPointer(a.firstSegment);
  const float* composited = hostPointer(a.composited);
  const float* specular = hostPointer(a.specular);
  const float* opacities = hostPointer(a.opacities);
  const float* depths = hostPointer(a.depths);
  float* colour = hostPointer(a.colour);
  float* opacity = hostPointer(a.opacity);
  float* depth = hostPointer(a.depth);
  context.pool.forRanges(hostCount(a.rays), kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      float transmittance = 1, sum[3] = {0, 0, 0}, far = 0;
      for (uint32_t k = firstSegment[ray]; k < firstSegment[ray + 1]; ++k) {
        const float gate = a.literal ? 1 : opacities[k];
        for (int c = 0; c < 3; ++c) {
          sum[c] += transmittance * (composited[size_t{kComposited} * k + c] + gate * specular[size_t{3} * k + c]);
        }
        far += transmittance * depths[k];
        transmittance *= 1 - opacities[k];
      }
      for (int c = 0; c < 3; ++c) colour[3 * ray + c] = sum[c];
      opacity[ray] = 1 - transmittance;
      depth[ray] = far;
    }
  });
}

void run(Context& context, const BlendBackward& a) {
  const uint32_t* firstSegment = hostPointer(a.firstSegment);
  const float* composited = hostPointer(a.composited);
  const float* specular = hostPointer(a.specular);
  const float* opacities = hostPointer(a.opacities);
  const float* colourOfRay = hostPointer(a.rayColourGradients);
  const float* opacityOfRay = hostPointer(a.rayOpacityGradients);
  float* compositedGradients = hostPointer(a.compositedGradients);
  float* specularGradients = hostPointer(a.specularGradients);
  float* opacityGradients = hostPointer(a.opacityGradients);
  context.pool.forRanges(hostCount(a.rays), kRaysPerTask, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      const uint32_t first = firstSegment[ray], last = firstSegment[ray + 1];
      float transmittance = 1;
      for (uint32_t k = first; k < last; ++k) {  // stores the transmittance in front of k in place of its gradient
        opacityGradients[k] = transmittance;
        transmittance *= 1 - opacities[k];
      }
      const float* g = colourOfRay + 3 * ray;
      float rear = opacityOfRay ? -opacityOfRay[ray] : 0;  // as in compositing
      for (uint32_t k = last; k-- > first;) {
        const float before = opacityGradients[k], gate = a.literal ? 1 : opacities[k];
        const float* diffuse = composited + size_t{kComposited} * k;
        const float* added = specular + size_t{3} * k;
        float* dComposited = compositedGradients + size_t{kComposited} * k;
        std::fill_n(dComposited, kComposited, 0.0f);
        float value = 0, valueOfAdded = 0;
        for (int c = 0; c < 3; ++c) {
          value += g[c] * (diffuse[c] + gate * added[c]);
          valueOfAdded += g[c] * added[c];
          dComposited[c] = before * g[c];
          specularGradients[size_t{3} * k + c] = before * gate * g[c];
        }
        opacityGradients[k] = before * ((a.literal ? 0 : valueOfAdded) - rear);
        rear = value + (1 - opacities[k]) * rear;
      }
    }
  });
}

}  // namespace tessera::cpu
