// Analytic sun and sky. The unit of radiance is such that a white wall in full sun shows about 3.
#pragma once

#include "synth/noise.h"

namespace tessera {

struct Sky {
  Vec3f towardsSun{0, 0, 1};
  Vec3f sunLight{3.1f, 2.75f, 2.25f};  // irradiance / π at normal incidence
  float sunRadius = 0.0047f;           // angular radius of the sun, radians
  uint32_t seed = 0;

  static Sky ofDay(uint64_t seed);
  // A clear gradient, a brighter rim around the sun and thin clouds; below the horizon, distant land.
  Vec3f radiance(const Vec3f& direction) const;
};

}  // namespace tessera
