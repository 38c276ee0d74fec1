// A grid of octahedra with its field, in the region of interest of a capture.
#pragma once

#include "representations/mesh/train/config.h"
#include "representations/mesh/train/mesh_field.h"
#include "train/occupancy_grid.h"
#include "train/scene_frame.h"

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

class MeshModel {
 public:
  // Keeps a reference to `device`.
  MeshModel(Device& device, const MeshConfig& config, const SceneFrame& frame);

  struct Rays {
    uint32_t count;
    Slice<const float> origins, directions, far;  // far: optional
  };
  // Finds the hits of rays in occupied cells and their neighbours; each ray keeps its nearest `maximum`.
  void trace(const Rays& rays, uint32_t maximum, MeshHits& hits);
  // From now on, rays hit only these faces (bits, TraceOctahedra::keptFaces); all faces if empty.
  void keepFaces(const std::vector<uint32_t>& bits);
  // Adds to the gradients of the vertices.
  void backward(const Rays& rays, const MeshHits& hits, Slice<const float> positionGradients);

  // Cells that are not `possible` are empty and remain so. All others are occupied.
  void exclude(const std::vector<bool>& possible);
  // Raises the occupancy to the opacities of the hits that rays reach.
  void addOccupancy(const Rays& rays, const MeshHits& hits, Matrix<const float> logits);
  // Lets the occupancy decay: cells without recent hits that rays reach become empty.
  void refreshOccupancy();

  Device& device() { return device_; }
  MeshField& field() { return field_; }
  OccupancyGrid& occupancy() { return occupancy_; }
  ParameterGroup& displacements() { return displacements_; }  // [cells][3], in edges of a cell
  const OctahedraGrid& grid() const { return grid_; }
  const MeshConfig& config() const { return config_; }
  const SceneFrame& frame() const { return frame_; }
  float opacityOffset() const { return static_cast<float>(config_.opacityOffset); }

  // The state consists of the parameters (with moments for training) and the occupancy.
  bool allFinite();
  void save(TensorSet& tensors, bool withMoments);
  void restore(const fs::path& path, const Safetensors& file);

 private:
  void updateTracedCells();

  Device& device_;
  MeshConfig config_;
  SceneFrame frame_;
  OctahedraGrid grid_;
  MeshField field_;
  ParameterGroup displacements_;
  OccupancyGrid occupancy_;
  Array<uint32_t> tracedCells_;  // occupied cells and their neighbours, as OccupancyGrid::bits
  Array<uint32_t> keptFaces_;    // without elements: all faces are
};

// Returns the cells of a grid, bits of [cells³], that are set or have a neighbour that is, diagonal ones included.
std::vector<uint32_t> dilateCells(std::span<const uint32_t> bits, uint32_t cells);

// Loads a trained model from its folder for rendering. Throws Error if its files are missing or malformed.
std::unique_ptr<MeshModel> loadMeshModel(Device& device, const fs::path& folder);

}  // namespace tessera
