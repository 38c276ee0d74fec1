// One level of detail of a part of a mesh: its grids of octahedra, the places of their vertices, and which cells are
// occupied. All levels share the networks and the hash grid of the part.
#pragma once

#include "compute/octahedra.h"
#include "field/parameters.h"
#include "representations/mesh/train/face_set.h"
#include "representations/mesh/train/mesh_part.h"
#include "train/occupancy_grid.h"

namespace tessera {

// The hits of a set of rays, in device memory, in the order of rays and of distances.
struct MeshHits {
  Array<uint32_t> firstSample, rayOfSample, faces;
  Array<float> barycentrics, positions, distances;
  Slice<uint32_t> counters;  // [kCounters]: number of hits, number of rays whose hits fit; set by the caller

  static constexpr uint32_t kCounters = 2;

  MeshHits() = default;
  MeshHits(Device& device, uint32_t rays, uint32_t samples);

  Count samples() const { return {static_cast<uint32_t>(distances.size()), counters.part(0, 1)}; }
  Count finished(uint32_t rays) const { return {rays, counters.part(1, 1)}; }
};

struct MeshRays {
  uint32_t count;
  Slice<const float> origins, directions, far;  // far: optional
};

class MeshLevel {
 public:
  struct Settings {
    float near = 0;            // distance from the camera at which rays begin
    float minCosine = 0.1f;    // OctahedraBackward::minCosine
    float opacityOffset = 0;   // added to logits
    float occupancyDecay = 1;  // per update
    bool quads = false;        // rays hit only FaceSet::quads
    bool forTraining = true;   // else `backward` may not be called
  };
  // `number`: 0 is the finest. displacements: [grids][cells][3]. All cells are occupied. Keeps a reference to `device`.
  MeshLevel(Device& device, uint32_t number, OctahedraDomain domain, const Settings& settings,
            const std::vector<float>& displacements);

  // Finds the hits of rays in traced cells; each ray keeps its nearest `maximum`. `inOwn`: only within the domain's
  // ownGrids.
  void trace(const MeshRays& rays, uint32_t maximum, bool inOwn, MeshHits& hits);
  // From now on, rays hit only these faces (bits, TraceOctahedra::keptFaces); all if empty.
  void keepFaces(const std::vector<uint32_t>& bits);
  // From now on, rays hit only these faces, and all of each, whatever cells are occupied: occupancy plays no role any
  // more.
  void limitToFaces(const FaceSet& faces);
  // Undoes limitToFaces.
  void removeLimit();
  // Adds to the gradients of the vertices.
  void backward(const MeshRays& rays, const MeshHits& hits, Slice<const float> positionGradients);

  // Cells that are not `possible` are empty and remain so. All others are occupied.
  void exclude(const std::vector<bool>& possible);
  // Raises the occupancy to the opacities of the hits that rays reach.
  void addOccupancy(const MeshRays& rays, const MeshHits& hits, Matrix<const float> logits);
  // Lets the occupancy decay: cells without recent hits that rays reach become empty. From now on, occupied cells are
  // traced and, if requested, their neighbours, so that surfaces can grow.
  void refreshOccupancy(bool tracesNeighbours);

  const OctahedraDomain& domain() const { return domain_; }
  ParameterGroup& displacements() { return displacements_; }  // [grids][cells][3], in edges of a cell
  OccupancyGrid& occupancy() { return occupancy_; }           // of the lattice
  // Bits, [grids][words()].
  std::vector<uint32_t> tracedCells() const { return device_.read(tracedCells_.all()); }

  // The state consists of the displacements (with moments for training) and the occupancy.
  static std::string tensorPrefix(uint32_t number);  // "level2."
  void save(TensorSet& tensors, bool withMoments);
  void restore(const fs::path& path, const Safetensors& file);

 private:
  void updateTracedCells();

  Device& device_;
  std::string prefix_;
  OctahedraDomain domain_;
  Settings settings_;
  ParameterGroup displacements_;
  OccupancyGrid occupancy_;
  bool tracesNeighbours_ = true;
  Array<uint32_t> tracedCells_;
  Array<uint32_t> keptFaces_;  // without elements: all faces are
  bool isLimited_ = false;     // limitToFaces was called
};

}  // namespace tessera
