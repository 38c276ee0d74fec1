#include "synth/light_volume.h"

#include <numbers>

#include "synth/surface.h"

namespace tessera {
namespace {

constexpr int kDirections = 72;
constexpr float kTextureWidth = 1.5f;  // bounced light carries only large-scale colours

// Returns a spherical Fibonacci point.
Vec3f fibonacciDirection(int i) {
  const float z = 1 - (2 * static_cast<float>(i) + 1) / kDirections;
  const float angle = static_cast<float>(i) * std::numbers::pi_v<float> * (3 - std::sqrt(5.f));
  const float r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

}  // namespace

LightVolume::LightVolume(const CityLayout& city, const TraceScene& scene, const Sky& sky, ThreadPool& pool) {
  const float margin = 24;
  float low = 1e9f, high = -1e9f;
  for (float x = city.area.x0 - margin; x <= city.area.x1 + margin; x += 10)
    for (float y = city.area.y0 - margin; y <= city.area.y1 + margin; y += 10) low = std::min(low, city.terrain(x, y));
  for (const Building& b : city.buildings) high = std::max(high, b.base + b.height() + 4);
  for (const Tree& t : city.trees) high = std::max(high, city.terrain(t.foot.x(), t.foot.y()) + t.height);
  low -= 1;
  high = std::max(high, low + 10);
  origin_ = {city.area.x0 - margin, city.area.y0 - margin, low};
  const Vec3f extent(city.area.width() + 2 * margin, city.area.depth() + 2 * margin, high - low);
  for (int a = 0; a < 3; ++a) size_[a] = static_cast<int>(std::ceil(extent[a] / step_[a])) + 1;
  probes_.resize(static_cast<size_t>(size_[0]) * size_[1] * size_[2]);

  pool.run(static_cast<size_t>(size_[1]) * size_[2], [&](size_t row, int) {
    const int y = static_cast<int>(row % size_[1]), z = static_cast<int>(row / size_[1]);
    for (int x = 0; x < size_[0]; ++x) {
      const Vec3f place = origin_ + Vec3f(x * step_.x(), y * step_.y(), z * step_.z());
      Probe probe;
      probe.light.fill(Vec3f::Zero());
      std::array<float, 6> total{};
      int behind = 0;
      for (int i = 0; i < kDirections; ++i) {
        const Vec3f direction = fibonacciDirection(i);
        Vec3f light;
        if (const auto hit = scene.intersect({place, direction, 1e-3f})) {
          if (hit->backFace && hit->material != Material::leaf) ++behind;
          const Surface s = surfaceAt(city, *hit, kTextureWidth);
          const float facing = std::max(0.f, s.normal.dot(sky.towardsSun));
          Vec3f arriving = Vec3f(0.28f, 0.33f, 0.42f);
          if (facing > 0 && !scene.occluded({hit->position + hit->normal * 0.02f, sky.towardsSun}))
            arriving += sky.sunLight * facing;
          light = s.albedo.cwiseProduct(arriving);
        } else {
          light = sky.radiance(direction);
        }
        for (int face = 0; face < 6; ++face) {
          const float weight = std::max(0.f, (face % 2 == 0 ? 1.f : -1.f) * direction[face / 2]);
          probe.light[face] += light * weight;
          total[face] += weight;
        }
      }
      for (int face = 0; face < 6; ++face) probe.light[face] /= total[face];
      probe.weight = behind * 4 > kDirections ? 0.f : 1.f;
      probes_[(static_cast<size_t>(z) * size_[1] + y) * size_[0] + x] = probe;
    }
  });
}

Vec3f LightVolume::openSky(const Vec3f& normal) const {
  return mix(Vec3f(0.24f, 0.23f, 0.19f), Vec3f(0.44f, 0.55f, 0.75f), 0.5f + 0.5f * normal.z());
}

Vec3f LightVolume::at(const Vec3f& xInWorld, const Vec3f& normal) const {
  if (probes_.empty()) return openSky(normal);
  // Samples half a cell off the wall, where the probes lie in the air.
  const Vec3f cell = (xInWorld + normal.cwiseProduct(step_) * 0.5f - origin_).cwiseQuotient(step_);
  float outside = 0;
  std::array<int, 3> base{};
  Vec3f f;
  for (int a = 0; a < 3; ++a) {
    const float limit = static_cast<float>(size_[a] - 1);
    outside = std::max(outside, std::max(-cell[a], cell[a] - limit));
    const float inside = clamped(cell[a], 0, limit - 1e-3f);
    base[a] = static_cast<int>(inside);
    f[a] = inside - static_cast<float>(base[a]);
  }
  if (outside >= 4) return openSky(normal);
  Vec3f sum = Vec3f::Zero();
  float total = 0;
  for (int corner = 0; corner < 8; ++corner) {
    size_t index = 0;
    float weight = 1;
    for (int a = 2; a >= 0; --a) {
      const int bit = (corner >> a) & 1;
      index = index * size_[a] + std::min(base[a] + bit, size_[a] - 1);
      weight *= bit != 0 ? f[a] : 1 - f[a];
    }
    const Probe& probe = probes_[index];
    weight *= probe.weight;
    if (weight <= 0) continue;
    Vec3f light = Vec3f::Zero();
    for (int a = 0; a < 3; ++a) light += probe.light[2 * a + (normal[a] < 0 ? 1 : 0)] * (normal[a] * normal[a]);
    sum += light * weight;
    total += weight;
  }
  if (total < 1e-3f) return openSky(normal) * 0.4f;
  return mix(Vec3f(sum / total), openSky(normal), clamped(outside / 4));
}

}  // namespace tessera
