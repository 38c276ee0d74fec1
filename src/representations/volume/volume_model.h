// A `volume` model (City-on-Web, section 4): the parameters of all blocks of a scene, and where in the world they
// stand.
#pragma once

#include "compute/deferred.h"
#include "field/block_fields.h"
#include "representations/volume/config.h"
#include "representations/volume/levels.h"
#include "scene/block_grid.h"
#include "train/scene_frame.h"

namespace tessera {

// Scene units of BlockSpace: half a block's edge is 1, the origin amid all blocks at half the scene's height.
SceneFrame sceneFrameOf(const BlockGrid& grid);
BlockSpace blockSpaceOf(const BlockGrid& grid, const VolumeConfig& config);

class VolumeModel {
 public:
  VolumeModel(Device& device, const VolumeConfig& config, const BlockGrid& grid);

  Device& device() { return device_; }
  const VolumeConfig& config() const { return config_; }
  const BlockGrid& grid() const { return grid_; }
  const SceneFrame& frame() const { return frame_; }
  const BlockSpace& space() const { return space_; }
  const VirtualGrid& virtualGrid() const { return virtualGrid_; }
  // Until the next call, everything is seen through this grid: a coarser level begins with that of the one below.
  void lookThrough(const VirtualGrid& grid) { virtualGrid_ = grid; }
  const LevelGroups& groups() const { return groups_; }  // which blocks are composited and shaded together
  Slice<const uint32_t> groupOfBlock() const { return groupOfBlock_; }
  BlockFields& attributes() { return attributes_; }
  BlockFields& proposals() { return proposals_; }
  ParameterGroup& deferred() { return deferred_; }  // [groups][DeferredNetwork::kParameters]

  // Values of the other's attribute and proposal fields; of the same blocks, with the same settings of fields.
  void copyFields(VolumeModel& from);

  // Of one block; the deferred networks of all groups stand with block 0.
  void save(uint32_t block, TensorSet& tensors, bool withMoments);
  void restore(uint32_t block, const fs::path& path, const Safetensors& file);

 private:
  Device& device_;
  VolumeConfig config_;
  BlockGrid grid_;
  SceneFrame frame_;
  BlockSpace space_;
  VirtualGrid virtualGrid_;
  LevelGroups groups_;
  Array<uint32_t> groupOfBlock_;
  BlockFields attributes_, proposals_;
  ParameterGroup deferred_;
};

}  // namespace tessera
