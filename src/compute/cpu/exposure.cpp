#include "compute/exposure.h"

#include <cmath>

#include "compute/cpu/kernels.h"
#include "compute/host_memory.h"

namespace tessera::cpu {

void run(Context& context, const ExposureForward& a) {
  const float* colours = hostPointer(a.colours);
  const uint32_t* photoOfRay = hostPointer(a.photoOfRay);
  const float* logGains = hostPointer(a.logGains);
  const float* opacity = hostPointer(a.opacity);
  const float* background = hostPointer(a.background);
  float* exposed = hostPointer(a.exposed);
  context.pool.forRanges(hostCount(a.rays), 1024, [&](size_t begin, size_t end) {
    for (size_t ray = begin; ray < end; ++ray) {
      for (int k = 0; k < 3; ++k) {
        float value = colours[3 * ray + k] * std::exp2(logGains[3 * photoOfRay[ray] + k]);
        if (background) value += (1 - opacity[ray]) * background[3 * ray + k];
        exposed[3 * ray + k] = value;
      }
    }
  });
}

void run(Context&, const ExposureBackward& a) {
  const float* colours = hostPointer(a.colours);
  const uint32_t* photoOfRay = hostPointer(a.photoOfRay);
  const float* logGains = hostPointer(a.logGains);
  const float* exposedGradients = hostPointer(a.exposedGradients);
  const float* background = hostPointer(a.background);
  float* colourGradients = hostPointer(a.colourGradients);
  float* opacityGradients = hostPointer(a.opacityGradients);
  float* logGainGradients = hostPointer(a.logGainGradients);
  constexpr float kLn2 = 0.69314718056f;
  const size_t rays = hostCount(a.rays);
  for (size_t ray = 0; ray < rays; ++ray) {  // serial: too few rays to split, and the order of the sums is fixed
    float behind = 0;
    for (int k = 0; k < 3; ++k) {
      const size_t photo = 3 * photoOfRay[ray] + k;
      if (background) behind += exposedGradients[3 * ray + k] * background[3 * ray + k];
      const float gain = std::exp2(logGains[photo]), g = exposedGradients[3 * ray + k];
      logGainGradients[photo] += g * colours[3 * ray + k] * gain * kLn2;
      colourGradients[3 * ray + k] = g * gain;
    }
    if (background) opacityGradients[ray] = -behind;
  }
}

}  // namespace tessera::cpu
