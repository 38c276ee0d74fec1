#include "synth/sky.h"

#include <numbers>

#include "base/random.h"

namespace tessera {

Sky Sky::ofDay(uint64_t seed) {
  const RandomStream random(seed, 2);
  Sky sky;
  const float azimuth = (200 + 50 * random.uniform(0)) * std::numbers::pi_v<float> / 180;  // south-west to west
  const float elevation = (40 + 14 * random.uniform(1)) * std::numbers::pi_v<float> / 180;
  sky.towardsSun = {std::cos(elevation) * std::sin(azimuth), std::cos(elevation) * std::cos(azimuth),
                    std::sin(elevation)};
  sky.seed = random.bits32(2);
  return sky;
}

Vec3f Sky::radiance(const Vec3f& direction) const {
  const float up = direction.z();
  const Vec3f horizon(0.78f, 0.84f, 0.92f), zenith(0.20f, 0.37f, 0.72f), land(0.26f, 0.27f, 0.24f);
  if (up < 0) return mix(Vec3f(0.62f, 0.66f, 0.70f), land, clamped(-up * 12));
  Vec3f colour = mix(horizon, zenith, 1 - std::pow(1 - up, 3.2f));
  const float facing = std::max(0.f, direction.dot(towardsSun));
  colour += Vec3f(0.9f, 0.75f, 0.5f) * (0.35f * std::pow(facing, 24.f));
  const float x = direction.x() / (up + 0.12f), y = direction.y() / (up + 0.12f);
  const float cloud = smoothStep(0.0f, 0.7f, fractalNoise(x, y, seed, 1.1f, 5, 0.02f)) * smoothStep(0.02f, 0.25f, up);
  return mix(colour, Vec3f(0.98f, 0.97f, 0.95f), 0.65f * cloud);
}

}  // namespace tessera
