// Traces rays through patches of triangles and composites all hits in order, by Embree: the reference that defines what
// a mesh scene looks like (docs/tile-format.md, section 8).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/cpu/dense_network.h"
#include "representations/mesh/content/mesh_content.h"
#include "scene/axes.h"

namespace tessera {

// The triangles of a PatchSet.
struct PatchTriangles {
  std::vector<float> vertices;  // [patches][4][3]
  uint32_t pairs = 0;

  uint32_t patches() const { return static_cast<uint32_t>(vertices.size() / 12); }
};
PatchTriangles makePatchTriangles(const PatchSet& set);

struct MeshHit {
  float distance = 0;            // in multiples of the direction's length
  uint32_t content = 0;          // set by callers that trace several contents
  uint32_t part = 0, patch = 0;  // of the content
  float column = 0, row = 0;     // place in the patch, 0 to 1
};

class MeshTracer {
 public:
  // Copies the triangles of the parts of a content. Throws Error if there is not enough memory.
  explicit MeshTracer(std::span<const PatchTriangles> parts);
  ~MeshTracer();
  MeshTracer(MeshTracer&&) noexcept;
  MeshTracer& operator=(MeshTracer&&) noexcept;

  // Adds the hits of a ray at distances in (near, far), in no order. May be called by several threads at a time.
  void addHits(const Vec3f& origin, const Vec3f& direction, float near, float far, std::vector<MeshHit>& hits) const;
  // Memory in bytes, as Embree counts it.
  uint64_t memoryBytes() const;

 private:
  struct Embree;
  std::unique_ptr<Embree> embree_;
};

// What hits look like. Functions may be called by several threads at a time.
class HitShading {
 public:
  virtual ~HitShading() = default;
  virtual MeshTexel texel(const MeshHit& hit) const = 0;
  virtual const DenseNetwork& decoder(const MeshHit& hit) const = 0;
};

struct CompositedRay {
  std::array<float, 3> colour{};       // premultiplied
  float transmittance = 1, depth = 0;  // depth: Σ weight · distance
  uint32_t samples = 0;                // hits whose colours were evaluated
};
// Sorts the hits of a ray by distance (equal ones by content, part and patch) and composites them behind what `ray`
// holds, until its transmittance falls below `minTransmittance`. `direction`: of length 1.
void compositeHits(std::vector<MeshHit>& hits, const Vec3d& direction, float minTransmittance,
                   const HitShading& shading, CompositedRay& ray);

}  // namespace tessera
