// Light from the sky and from one bounce, on a grid of probes in the city's air: smooth and noise-free, whereas ambient
// occlusion rays per sample would make photos noisy.
// After the ambient cube of Half-Life 2 (McTaggart, GDC 2004): six directions per probe.
#pragma once

#include <array>
#include <vector>

#include "base/threads.h"
#include "synth/layout.h"
#include "synth/sky.h"
#include "synth/tracer.h"

namespace tessera {

class LightVolume {
 public:
  LightVolume() = default;
  LightVolume(const CityLayout& city, const TraceScene& scene, const Sky& sky, ThreadPool& pool);

  // Returns irradiance / π at a surface: the radiance that a white diffuse surface would reflect.
  Vec3f at(const Vec3f& xInWorld, const Vec3f& normal) const;

 private:
  struct Probe {
    std::array<Vec3f, 6> light;  // from +x, -x, +y, -y, +z, -z
    float weight = 1;            // 0 inside a wall
  };
  Vec3f openSky(const Vec3f& normal) const;

  Vec3f origin_{0, 0, 0};
  Vec3f step_{4, 4, 3};
  std::array<int, 3> size_{0, 0, 0};
  std::vector<Probe> probes_;
};

}  // namespace tessera
