// Ray casting against a SurfaceMesh, through Embree. Foliage is cut out inside the traversal in the same way for every
// ray, so that every photo sees the same leaves.
#pragma once

#include <limits>
#include <memory>
#include <optional>

#include "synth/surface_mesh.h"

struct RTCDeviceTy;
struct RTCSceneTy;

namespace tessera {

struct Ray {
  Vec3f origin{0, 0, 0};
  Vec3f direction{0, 0, 1};  // unit
  float near = 0;
  float far = std::numeric_limits<float>::infinity();
};

struct SurfaceHit {
  float distance = 0;
  Vec3f position{0, 0, 0};
  Vec3f normal{0, 0, 1};  // unit; of the triangle, turned towards the ray's origin
  bool backFace = false;
  Vec2f textureAt{0, 0};  // metres
  Material material = Material::plain;
  const SurfaceObject* object = nullptr;
  uint32_t face = 0;
};

class TraceDevice {
 public:
  TraceDevice();
  RTCDeviceTy* get() const { return device_.get(); }

 private:
  std::shared_ptr<RTCDeviceTy> device_;
};

// Keeps a reference to the mesh. All queries are const and may be called by any number of threads.
class TraceScene {
 public:
  TraceScene(const TraceDevice& device, const SurfaceMesh& mesh);

  std::optional<SurfaceHit> intersect(const Ray& ray) const;
  bool occluded(const Ray& ray) const;

 private:
  const SurfaceMesh* mesh_;
  std::shared_ptr<RTCSceneTy> scene_;
};

}  // namespace tessera
