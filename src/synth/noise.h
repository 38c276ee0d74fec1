// Building blocks of procedural textures. `width` is always the footprint of the sample in the unit of the coordinate:
// detail finer than it fades to its mean, so that textures do not alias between supersamples.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "scene/axes.h"

namespace tessera {

using Vec2f = Eigen::Vector2f;

inline uint32_t latticeHash(int x, int y, uint32_t seed) {
  uint32_t h = seed * 0x9e3779b1u ^ static_cast<uint32_t>(x) * 0x85ebca77u ^ static_cast<uint32_t>(y) * 0xc2b2ae3du;
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  return h ^ (h >> 15);
}

// Uniform in [0, 1), one value per lattice cell.
inline float latticeRandom(int x, int y, uint32_t seed) {
  return static_cast<float>(latticeHash(x, y, seed) >> 8) * 0x1p-24f;
}

inline int floorInt(float x) {
  return static_cast<int>(std::floor(x));
}
inline float fraction(float x) {
  return x - std::floor(x);
}
inline float clamped(float x, float low = 0, float high = 1) {
  return std::min(std::max(x, low), high);
}
inline float smoothStep(float low, float high, float x) {
  const float t = clamped((x - low) / (high - low));
  return t * t * (3 - 2 * t);
}
template <class V>
V mix(const V& a, const V& b, float t) {
  return a + (b - a) * t;
}

// Smooth noise in [-1, 1] on the unit lattice.
inline float valueNoise(float x, float y, uint32_t seed) {
  const int ix = floorInt(x), iy = floorInt(y);
  float fx = x - ix, fy = y - iy;
  fx = fx * fx * (3 - 2 * fx);
  fy = fy * fy * (3 - 2 * fy);
  const float a = latticeRandom(ix, iy, seed), b = latticeRandom(ix + 1, iy, seed);
  const float c = latticeRandom(ix, iy + 1, seed), d = latticeRandom(ix + 1, iy + 1, seed);
  return 2 * (a + (b - a) * fx + (c - a) * fy + (a - b - c + d) * fx * fy) - 1;
}

// Sums octaves of halving wavelength and amplitude, roughly in [-1, 1]; octaves shorter than two footprints fade out.
inline float fractalNoise(float x, float y, uint32_t seed, float wavelength, int octaves, float width) {
  float sum = 0, amplitude = 0.6f;
  for (int octave = 0; octave < octaves; ++octave, wavelength *= 0.5f, amplitude *= 0.5f) {
    const float keep = clamped(wavelength / (2 * width + 1e-6f) - 0.5f);
    if (keep <= 0) break;
    sum += keep * amplitude * valueNoise(x / wavelength, y / wavelength, seed + 101u * octave);
  }
  return sum;
}

// Returns the fraction of [x - width/2, x + width/2] that lies in [low, high].
inline float covered(float x, float low, float high, float width) {
  const float half = 0.5f * std::max(width, 1e-4f);
  return clamped((std::min(x + half, high) - std::max(x - half, low)) / (2 * half));
}

// Returns the same for stripes [0, line) repeated every `period`; fades to the mean when the footprint exceeds the
// period.
inline float stripes(float x, float period, float line, float width) {
  const float mean = line / period;
  if (width >= period) return mean;
  const float f = fraction(x / period) * period;
  const float sharp = std::min(
      1.f, covered(f, 0, line, width) + covered(f - period, 0, line, width) + covered(f + period, 0, line, width));
  return mix(sharp, mean, clamped(2 * width / period - 1));
}

// A sequence of random numbers for procedural generation.
class RandomSequence {
 public:
  explicit RandomSequence(uint32_t seed) : seed_(seed) {}
  float uniform() { return latticeRandom(static_cast<int>(count_++), 0x51ed, seed_); }
  float between(float low, float high) { return low + (high - low) * uniform(); }
  int below(int n) { return std::min(n - 1, static_cast<int>(uniform() * static_cast<float>(n))); }
  bool chance(float p) { return uniform() < p; }
  uint32_t seed() { return latticeHash(static_cast<int>(count_++), 0x7a11, seed_); }

 private:
  uint32_t seed_;
  uint32_t count_ = 0;
};

}  // namespace tessera
