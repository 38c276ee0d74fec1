#include "compute/exposure.h"

#include <cmath>

#include "compute/reference/convert.h"

namespace tessera::reference {

void run(const ExposureForward& a) {
  const size_t rays = hostCount(a.rays);
  const Indices photoOfRay = indices(a.photoOfRay, rays);
  const Doubles logGains = doubles(a.logGains, a.logGains.count);
  const Doubles opacity = doubles(a.opacity, a.background ? rays : 0), background = doubles(a.background, 3 * rays);
  Doubles exposed = doubles(a.colours, 3 * rays);
  for (size_t i = 0; i < 3 * rays; ++i) {
    exposed[i] *= std::exp2(logGains[3 * photoOfRay[i / 3] + i % 3]);
    if (a.background) exposed[i] += (1 - opacity[i / 3]) * background[i];
  }
  store(a.exposed, exposed);
}

void run(const ExposureBackward& a) {
  const size_t rays = hostCount(a.rays);
  const Indices photoOfRay = indices(a.photoOfRay, rays);
  const Doubles logGains = doubles(a.logGains, a.logGains.count), colours = doubles(a.colours, 3 * rays);
  const Doubles background = doubles(a.background, 3 * rays);
  Doubles gradients = doubles(a.exposedGradients, 3 * rays), gainGradients(a.logGains.count), opacityGradients(rays);
  for (size_t i = 0; i < 3 * rays; ++i) {
    if (a.background) opacityGradients[i / 3] -= gradients[i] * background[i];
    const size_t gain = 3 * photoOfRay[i / 3] + i % 3;
    gradients[i] *= std::exp2(logGains[gain]);
    gainGradients[gain] += gradients[i] * colours[i] * std::log(2.0);
  }
  store(a.colourGradients, gradients);
  if (a.background) store(a.opacityGradients, opacityGradients);
  add(a.logGainGradients, gainGradients);
}

}  // namespace tessera::reference
