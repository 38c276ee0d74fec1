// A mesh of one block: levels of detail of octahedra in the region of interest of a capture, and the field that gives
// all of them their opacities and colours.
#pragma once

#include <memory>

#include "representations/mesh/train/config.h"
#include "representations/mesh/train/mesh_field.h"
#include "representations/mesh/train/mesh_level.h"
#include "train/scene_frame.h"

namespace tessera {

class MeshModel {
 public:
  // Has the finest level. Keeps a reference to `device`.
  MeshModel(Device& device, const MeshConfig& config, const SceneFrame& frame);

  uint32_t levels() const { return static_cast<uint32_t>(levels_.size()); }
  MeshLevel& level(uint32_t number) { return *levels_[number]; }
  // Adds the coarser levels, each from the next finer one (MergeOctahedra); `seed`: of the points at which opacities
  // are compared.
  void addCoarseLevels(uint64_t seed);

  Device& device() { return device_; }
  MeshField& field() { return field_; }
  const MeshConfig& config() const { return config_; }
  const SceneFrame& frame() const { return frame_; }
  float opacityOffset() const { return static_cast<float>(config_.opacityOffset); }

  // The state consists of the parameters (with moments for training) and of the levels that there are.
  bool allFinite();
  void save(TensorSet& tensors, bool withMoments);
  void restore(const fs::path& path, const Safetensors& file);

 private:
  std::unique_ptr<MeshLevel> makeLevel(uint32_t number, const std::vector<float>& displacements);
  std::unique_ptr<MeshLevel> mergeLevel(uint32_t number, uint64_t seed);

  Device& device_;
  MeshConfig config_;
  SceneFrame frame_;
  MeshField field_;
  std::vector<std::unique_ptr<MeshLevel>> levels_;
};

// Loads a trained model from its folder for rendering. Throws Error if its files are missing or malformed.
std::unique_ptr<MeshModel> loadMeshModel(Device& device, const fs::path& folder);

}  // namespace tessera
