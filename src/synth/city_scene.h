// A city ready to be photographed, and the light along a ray through it.
#pragma once

#include <optional>

#include "synth/city_geometry.h"
#include "synth/light_volume.h"
#include "synth/sky.h"
#include "synth/tracer.h"

namespace tessera {

// Built once, then only read. Not movable: tracing refers to the mesh.
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

// The cars of one photo.
struct TrafficScene {
  SurfaceMesh mesh;
  std::optional<TraceScene> tracer;

  TrafficScene(const CityScene& city, double seconds);
  TrafficScene(const TrafficScene&) = delete;
  TrafficScene& operator=(const TrafficScene&) = delete;
};

struct RayLight {
  Vec3f radiance{0, 0, 0};
  bool touchedTraffic = false;  // a moving car is seen, mirrored, or shades what is seen
};

// First surface along the ray, of the city and the traffic (may be null); `moving` says which.
std::optional<SurfaceHit> firstHit(const CityScene& city, const TrafficScene* traffic, const Ray& ray,
                                   bool* moving = nullptr);

// `spread`: width of the ray's footprint per metre. `jitter`: two numbers in [0, 1) that pick a point of the sun.
RayLight lightAlong(const CityScene& city, const TrafficScene* traffic, const Ray& ray, float spread,
                    const Vec2f& jitter);

}  // namespace tessera
