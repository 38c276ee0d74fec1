// A `volume` model (City-on-Web, section 4): the parameters of all blocks of a scene, and the placement of the blocks
// in the world.
#pragma once

#include "bake/levels.h"
#include "compute/deferred.h"
#include "field/block_fields.h"
#include "representations/volume/train/config.h"
#include "scene/block_grid.h"
#include "train/block_frame.h"
#include "train/model_folder.h"

namespace tessera {

class VolumeModel {
 public:
  struct Capacity {
    uint32_t cells = 0;       // resident at once; 0: all. A separate background block is always resident
    bool forTraining = true;  // otherwise only values are allocated
  };
  // Initially slot k holds block k, and the last slot the separate background block, if there is one. Keeps a reference
  // to `device`.
  VolumeModel(Device& device, const VolumeConfig& config, const BlockGrid& grid, const Capacity& capacity);
  VolumeModel(Device& device, const VolumeConfig& config, const BlockGrid& grid)
      : VolumeModel(device, config, grid, Capacity()) {}

  Device& device() { return device_; }
  const VolumeConfig& config() const { return config_; }
  const BlockGrid& grid() const { return grid_; }
  const SceneFrame& frame() const { return frame_; }
  const BlockSpace& space() const { return space_; }
  const VirtualGrid& virtualGrid() const { return virtualGrid_; }
  // Sets the grid through which all samples are interpolated, until the next call: a coarser level begins with the grid
  // of the level below.
  void setVirtualGrid(const VirtualGrid& grid) { virtualGrid_ = grid; }
  const LevelGroups& groups() const { return groups_; }  // which blocks are composited and shaded together
  BlockFields& attributes() { return attributes_; }      // [slots]
  BlockFields& proposals() { return proposals_; }
  ParameterGroup& deferred() { return deferred_; }  // [groups][DeferredNetwork::kParameters]

  // If all blocks are in memory, slot k holds block k.
  uint32_t slots() const { return static_cast<uint32_t>(blockOfSlot_.size()); }
  bool holdsAll() const { return slots() == space_.blocks(); }
  const std::vector<uint32_t>& blockOfSlot() const { return blockOfSlot_; }
  uint32_t findSlot(uint32_t block) const;  // kNoSlot if the block is not in memory
  // Arguments of operations: slotOfBlock is [blocks], empty where slot k holds block k; the others are [slots].
  Slice<const uint32_t> slotOfBlock() const { return holdsAll() ? Slice<const uint32_t>() : slotOfBlock_.all(); }
  Slice<const uint32_t> residentBlockNumbers() const { return residentBlockNumbers_; }
  Slice<const uint32_t> groupOfSlot() const { return groupOfSlot_; }
  // Assigns these blocks to the slots. Those that were not resident start with their initial parameters, until they are
  // restored.
  void assignSlots(const std::vector<uint32_t>& blockOfSlot);
  // Attaches the checkpoints of a trained model, [blocks]. Those of resident blocks are read at once, the others when
  // they become resident, one whole file after another. Throws Error if one cannot be read.
  void readFrom(std::vector<fs::path> files);
  // Makes these blocks resident, at most as many as there are slots, in any slots; other blocks stay or are evicted.
  // Requires readFrom() unless all are resident. Throws Error if a checkpoint cannot be read.
  void ensureResident(const std::vector<uint32_t>& blocks);

  // Copies the values of the attribute and proposal fields from a model with the same blocks and the same settings of
  // fields. Both must have all blocks in memory.
  void copyFields(VolumeModel& from);

  // Save and restore one resident block. The deferred networks of all groups are stored with block 0.
  void save(uint32_t block, TensorSet& tensors, bool withMoments);
  void restore(uint32_t block, const fs::path& path, const Safetensors& file);
  // Save and restore the fields of a block without the deferred networks.
  void saveFields(uint32_t block, TensorSet& tensors, bool withMoments);
  void restoreFields(uint32_t block, const fs::path& path, const Safetensors& file);
  // Saves the initial parameters of a block, which need not be in memory.
  void saveFirstFields(uint32_t block, TensorSet& tensors) const;
  void saveDeferred(TensorSet& tensors, bool withMoments) { tensors.add(device_, deferred_, withMoments); }
  void restoreDeferred(const fs::path& path, const Safetensors& file) { loadGroup(device_, path, file, deferred_); }

 private:
  void nameSlots();

  Device& device_;
  VolumeConfig config_;
  BlockGrid grid_;
  SceneFrame frame_;
  BlockSpace space_;
  VirtualGrid virtualGrid_;
  LevelGroups groups_;
  std::vector<uint32_t> blockOfSlot_;
  std::vector<fs::path> files_;
  Array<uint32_t> slotOfBlock_, residentBlockNumbers_, groupOfSlot_;
  BlockFields attributes_, proposals_;
  ParameterGroup deferred_;
};

}  // namespace tessera
