// Traces rays through the triangles of mesh contents and composites all hits in order, by Embree: the reference that
// defines what a mesh scene looks like.
#pragma once

#include <memory>
#include <span>

#include "representations/mesh/content/mesh_content.h"
#include "scene/axes.h"

namespace tessera {

class MeshTracer {
 public:
  // Keeps a reference to `content`. Throws Error if there is not enough memory.
  explicit MeshTracer(const MeshContent& content);
  ~MeshTracer();
  MeshTracer(MeshTracer&&) noexcept;
  MeshTracer& operator=(MeshTracer&&) noexcept;

  struct Hit {
    float distance = 0;  // in multiples of the direction's length
    uint32_t patch = 0;
    float column = 0, row = 0;  // texel coordinates in the patch
    const MeshContent* content = nullptr;
  };
  // Adds the hits of a ray at distances in (near, far), in no order. May be called by several threads at a time.
  void addHits(const Vec3f& origin, const Vec3f& direction, float near, float far, std::vector<Hit>& hits) const;

 private:
  struct Embree;
  std::unique_ptr<Embree> embree_;
};

struct CompositedRay {
  std::array<float, 3> colour{};  // premultiplied
  float opacity = 0, depth = 0;   // depth: Σ weight · distance
};
// Sorts the hits of a ray by distance and composites them until its transmittance falls below `minTransmittance`.
CompositedRay compositeHits(std::vector<MeshTracer::Hit>& hits, const Vec3f& direction, float minTransmittance);

}  // namespace tessera
