// A `volume` model (City-on-Web, section 4): the parameters of all blocks of a scene, and where in the world they
// stand.
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
  struct Room {
    uint32_t cells = 0;       // that are in memory at once; 0: all. A surround of its own always is
    bool forTraining = true;  // else values alone
  };
  // Slot k holds block k, the last slot an own surround.
  VolumeModel(Device& device, const VolumeConfig& config, const BlockGrid& grid, const Room& room);
  VolumeModel(Device& device, const VolumeConfig& config, const BlockGrid& grid)
      : VolumeModel(device, config, grid, Room()) {}

  Device& device() { return device_; }
  const VolumeConfig& config() const { return config_; }
  const BlockGrid& grid() const { return grid_; }
  const SceneFrame& frame() const { return frame_; }
  const BlockSpace& space() const { return space_; }
  const VirtualGrid& virtualGrid() const { return virtualGrid_; }
  // Until the next call, everything is seen through this grid: a coarser level begins with that of the one below.
  void lookThrough(const VirtualGrid& grid) { virtualGrid_ = grid; }
  const LevelGroups& groups() const { return groups_; }  // which blocks are composited and shaded together
  BlockFields& attributes() { return attributes_; }      // [slots]
  BlockFields& proposals() { return proposals_; }
  ParameterGroup& deferred() { return deferred_; }  // [groups][DeferredNetwork::kParameters]

  // Where all blocks are in memory, slots are blocks.
  uint32_t slots() const { return static_cast<uint32_t>(blockOfSlot_.size()); }
  bool holdsAll() const { return slots() == space_.blocks(); }
  const std::vector<uint32_t>& blockOfSlot() const { return blockOfSlot_; }
  uint32_t slotOf(uint32_t block) const;  // or kNoSlot
  // For operations: [blocks], nothing where slots are blocks; [slots]; [slots].
  Slice<const uint32_t> slotOfBlock() const { return holdsAll() ? Slice<const uint32_t>() : slotOfBlock_.all(); }
  Slice<const uint32_t> heldBlocks() const { return heldBlocks_; }
  Slice<const uint32_t> groupOfSlot() const { return groupOfSlot_; }
  // From now on these blocks are in the slots. Those that were not begin as blocks do, until they are restored.
  void hold(const std::vector<uint32_t>& blockOfSlot);
  // Of a trained model: its checkpoints, [blocks]. Those of the blocks that are in memory are read at once, the others
  // when they are brought in, whole files one after another. Throws Error when one cannot be read.
  void readFrom(std::vector<fs::path> files);
  // From now on these blocks are in memory, no more than there are slots for, in whatever slots; others stay or leave.
  void bring(const std::vector<uint32_t>& blocks);

  // Values of the other's attribute and proposal fields; of the same blocks, with the same settings of fields, all in
  // memory.
  void copyFields(VolumeModel& from);

  // Of one block that is in memory. The deferred networks of all groups stand with block 0.
  void save(uint32_t block, TensorSet& tensors, bool withMoments);
  void restore(uint32_t block, const fs::path& path, const Safetensors& file);
  // A block's fields alone, and the deferred networks alone.
  void saveFields(uint32_t block, TensorSet& tensors, bool withMoments);
  void restoreFields(uint32_t block, const fs::path& path, const Safetensors& file);
  // As the block begins; it need not be in memory.
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
  Array<uint32_t> slotOfBlock_, heldBlocks_, groupOfSlot_;
  BlockFields attributes_, proposals_;
  ParameterGroup deferred_;
};

}  // namespace tessera
