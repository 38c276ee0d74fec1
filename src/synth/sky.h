// Sun and sky in closed form. Radiance is in units where a white wall in full sun shows about 3.
#pragma once

#include "synth/noise.h"

namespace tessera {

struct Sky {
  Vec3f towardsSun{0, 0, 1};
  Vec3f sunLight{3.1f, 2.75f, 2.25f};  // irradiance at normal incidence over pi
  float sunRadius = 0.0047f;           // half the angle that the sun fills, radians
  uint32_t seed = 0;

  static Sky ofDay(uint64_t seed);
  // Clear gradient, a brighter rim round the sun, thin clouds; below the horizon, distant land.
  Vec3f radiance(const Vec3f& direction) const;
};

}  // namespace tessera
