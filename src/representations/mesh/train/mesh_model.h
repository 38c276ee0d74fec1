// A part of a mesh: levels of detail of octahedra, the field that gives all of them their opacities and colours, and
// for the outside, the sky.
#pragma once

#include <memory>
#include <optional>

#include "representations/mesh/train/config.h"
#include "representations/mesh/train/mesh_field.h"
#include "representations/mesh/train/mesh_level.h"
#include "representations/mesh/train/mesh_part.h"
#include "scene/surface_coverage.h"

namespace tessera {

// How the opacities of texels are stored.
struct StoredOpacity {
  static constexpr float kOpaqueFrom = 0.8f;        // from it on, as 1
  static constexpr float kTransparentBelow = 0.3f;  // below, as 0
};

// What the final stage of training fixes: the faces of the finest level that are drawn, and how their texels are
// stored.
struct MeshAtlas {
  uint32_t patchEdge = 0;  // texels along the edge of a patch
  FaceSet faces;
  std::vector<float> ranges;  // of the features, [MeshField::kFeatures][2]
  SurfaceCoverage coverage;   // of the faces, when it was last checked; without pixels if it was not
};

// Returns the coverage in a checkpoint of a part; nothing if it was not checked. Throws Error if it is malformed.
std::optional<SurfaceCoverage> readCoverage(const MeshPart& part, const fs::path& path, const Safetensors& checkpoint);
// Returns the number of levels in a checkpoint of a part.
uint32_t countLevels(const MeshConfig& config, const MeshPart& part, const Safetensors& checkpoint);
// Whether a checkpoint of a part has its atlas: that of the final stage.
bool hasAtlas(const Safetensors& checkpoint);

// The same of a coarser level, whose texels are parameters of their own, with the ranges of the finest level.
struct CoarseAtlas {
  FaceSet faces;
  ParameterGroup texels;  // [texels of TexelAtlas][MeshField::kFeatures]
};

// What a model is in memory for, which determines how much of it is there.
enum class MeshUse {
  training,   // all
  baking,     // no gradients and moments
  rendering,  // of these, no coarser levels
};

class MeshModel {
 public:
  // Has the finest level. Keeps a reference to `device`.
  MeshModel(Device& device, const MeshConfig& config, const MeshPart& part, MeshUse use = MeshUse::training);

  uint32_t levels() const { return static_cast<uint32_t>(levels_.size()); }
  MeshLevel& level(uint32_t number) { return *levels_[number]; }
  // Adds the coarser levels of a block, each from the next finer one (MergeOctahedra); `seed`: of the points at which
  // opacities are compared.
  void addCoarseLevels(uint64_t seed);

  Device& device() { return device_; }
  MeshField& field() { return field_; }
  const MeshConfig& config() const { return config_; }
  const MeshPart& part() const { return part_; }
  const SceneFrame& frame() const { return part_.frame; }
  uint32_t maxLevels() const { return maxLevels(config_, part_); }
  static uint32_t maxLevels(const MeshConfig& config, const MeshPart& part) {
    return part.isBackground() ? 1 : config.levels();
  }
  // Nothing before the final stage. From then on, rays hit its faces alone.
  const std::optional<MeshAtlas>& atlas() const { return atlas_; }
  void setAtlas(MeshAtlas atlas);
  void setAtlasRanges(std::vector<float> ranges) { atlas_->ranges = std::move(ranges); }
  void setCoverage(SurfaceCoverage coverage) { atlas_->coverage = std::move(coverage); }
  // Also removes the coarser levels, if they were fitted to it.
  void removeAtlas();
  // Of a coarser level that was fitted; null if it was not, and for level 0.
  CoarseAtlas* coarseAtlas(uint32_t level) {
    return level > 0 && level <= coarse_.size() ? &coarse_[level - 1] : nullptr;
  }
  // Adds that of the next coarser level, whose rays hit these faces alone from then on. `texels`: their initial values.
  void addCoarseAtlas(FaceSet faces, const std::vector<float>& texels);

  // The cube map of the sky behind the outside, CubeMapForward::texels.
  static constexpr uint32_t kSkyResolution = 64;
  ParameterGroup& sky() { return sky_; }
  float opacityOffset() const { return static_cast<float>(config_.opacityOffset); }

  // The state consists of the parameters (with moments for training), the levels that there are, and the atlas. A model
  // that is not for training restores its share of it, and is not saved.
  bool allFinite();
  void save(TensorSet& tensors, bool withMoments);
  void restore(const fs::path& path, const Safetensors& file);

 private:
  std::unique_ptr<MeshLevel> makeLevel(uint32_t number, const std::vector<float>& displacements);
  std::unique_ptr<MeshLevel> mergeLevel(uint32_t number, uint64_t seed);
  OctahedraDomain domain(uint32_t level) const { return config_.domain(part_, level); }
  std::vector<ParameterGroup*> sharedGroups();
  void restoreAtlas(const fs::path& path, const Safetensors& file);
  bool isForTraining() const { return use_ == MeshUse::training; }

  Device& device_;
  MeshConfig config_;
  MeshPart part_;
  MeshUse use_;
  MeshField field_;
  ParameterGroup sky_;  // empty for a block
  std::vector<std::unique_ptr<MeshLevel>> levels_;
  std::optional<MeshAtlas> atlas_;
  std::vector<CoarseAtlas> coarse_;  // of levels 1, 2, 3, 4
};

}  // namespace tessera
