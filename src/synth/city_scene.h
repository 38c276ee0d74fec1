// A city ready to be photographed, and the radiance along a ray through it.
#pragma once

#include <optional>

#include "synth/city_geometry.h"
#include "synth/light_volume.h"
#include "synth/sky.h"
#include "synth/tracer.h"

namespace tessera {

// Built once, then only read. Not movable, because the tracer refers to the mesh.
struct CityScene {
  CityLayout layout;
  Sky sky;
  SurfaceMesh mesh;
  TraceDevice device;
  std::optional<TraceScene> tracer;
  LightVolume light;

  CityScene(int blocksX, int blocksY, uint64_t seed, ThreadPool& pool);
  CityScene(const CityScene&) = delete;
  CityScene& operator=(const CityScene&) = delete;
};

// The moving cars of one photo.
struct TrafficScene {
  SurfaceMesh mesh;
  std::optional<TraceScene> tracer;

  TrafficScene(const CityScene& city, double seconds);
  TrafficScene(const TrafficScene&) = delete;
  TrafficScene& operator=(const TrafficScene&) = delete;
};

struct RayLight {
  Vec3f radiance{0, 0, 0};
  bool touchedTraffic = false;  // a moving car is seen, mirrored, or shadows what is seen
};

// Returns the first surface along the ray, of the city or the traffic (may be null); `moving` tells whether it is
// traffic.
std::optional<SurfaceHit> firstHit(const CityScene& city, const TrafficScene* traffic, const Ray& ray,
                                   bool* moving = nullptr);

// Returns the radiance along a ray. `spread`: width of the ray's footprint per metre. `jitter`: two numbers in [0, 1)
// that select a point on the sun's disc.
RayLight lightAlong(const CityScene& city, const TrafficScene* traffic, const Ray& ray, float spread,
                    const Vec2f& jitter);

}  // namespace tessera
