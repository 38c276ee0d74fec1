#include "representations/volume/train/volume_model.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/error.h"
#include "base/random.h"

namespace tessera {
namespace {

Device& able(Device& device, const VolumeConfig& config) {
  config.check();
  return device;
}

// Returns Xavier weights and biases of 0, except that the last biases are low, so that training fits diffuse colours
// first.
std::vector<float> initialDeferred(uint32_t networks, uint64_t seed) {
  constexpr float kLastBias = -2;
  constexpr uint32_t kSizes[] = {DeferredNetwork::kInputs, DeferredNetwork::kHidden, DeferredNetwork::kHidden, 3};
  const RandomStream random(seed, 0xdefe);
  std::vector<float> values(size_t{networks} * DeferredNetwork::kParameters);
  for (uint32_t network = 0; network < networks; ++network) {
    for (int layer = 0; layer < 3; ++layer) {
      const uint32_t inputs = kSizes[layer], outputs = kSizes[layer + 1];
      const size_t first = size_t{network} * DeferredNetwork::kParameters + DeferredNetwork::kWeights[layer];
      const float bound = std::sqrt(6.0f / static_cast<float>(inputs + outputs));
      for (size_t i = 0; i < size_t{inputs} * outputs; ++i) {
        values[first + i] = (2 * random.uniform(first + i) - 1) * bound;
      }
      if (layer == 2)
        std::fill_n(values.begin() + static_cast<ptrdiff_t>(first + size_t{inputs} * outputs), 3, kLastBias);
    }
  }
  return values;
}

// Returns the first `cells` blocks, or all if 0, and the separate background block, if there is one.
std::vector<uint32_t> firstBlocks(const BlockSpace& space, uint32_t cells) {
  if (cells == 0) cells = space.cells();
  std::vector<uint32_t> blocks(std::min(cells, space.cells()));
  std::iota(blocks.begin(), blocks.end(), 0u);
  if (space.blocks() > space.cells()) blocks.push_back(space.cells());
  return blocks;
}

}  // namespace

VolumeModel::VolumeModel(Device& device, const VolumeConfig& config, const BlockGrid& grid, const Capacity& capacity)
    : device_(able(device, config)),
      config_(config),
      grid_(grid),
      frame_(makeSceneFrame(grid)),
      space_(makeBlockSpace(grid, config.near, config.backgroundBlockMode())),
      virtualGrid_(config.virtualGrid()),
      groups_(groupsOfLevel(space_.columns, space_.rows, static_cast<uint32_t>(config.lod),
                            space_.blocks() > space_.cells())),
      blockOfSlot_(firstBlocks(space_, capacity.cells)),
      slotOfBlock_(device.array<uint32_t>(space_.blocks())),
      residentBlockNumbers_(device.array<uint32_t>(slots())),
      groupOfSlot_(device.array<uint32_t>(slots())),
      attributes_(device, "attributes", config.attributeShape(), slots(), mix64(static_cast<uint64_t>(config.seed)),
                  capacity.forTraining),
      proposals_(device, "proposals", config.proposalShape(), slots(), mix64(static_cast<uint64_t>(config.seed) + 1),
                 capacity.forTraining),
      deferred_(device, "deferred", initialDeferred(groups_.groups(), static_cast<uint64_t>(config.seed)),
                capacity.forTraining) {
  nameSlots();
  if (space_.blocks() > space_.cells() && !holdsAll()) {
    attributes_.begin(slots() - 1, space_.cells());
    proposals_.begin(slots() - 1, space_.cells());
  }
  if (config.shareTexels || space_.blocks() == 1) return;
  throw Error("--set share_texels=false", "", "is for models of one block",
              "leave it at true, or use --blocks 1x1 and --set background_block=border");
}

uint32_t VolumeModel::findSlot(uint32_t block) const {
  const auto slot = std::find(blockOfSlot_.begin(), blockOfSlot_.end(), block);
  return slot == blockOfSlot_.end() ? kNoSlot : static_cast<uint32_t>(slot - blockOfSlot_.begin());
}

void VolumeModel::nameSlots() {
  std::vector<uint32_t> slotOfBlock(space_.blocks(), kNoSlot), groupOfSlot;
  for (uint32_t slot = 0; slot < slots(); ++slot) {
    slotOfBlock.at(blockOfSlot_[slot]) = slot;
    groupOfSlot.push_back(groups_.groupOfBlock[blockOfSlot_[slot]]);
  }
  device_.write(slotOfBlock_.all(), std::span<const uint32_t>(slotOfBlock));
  device_.write(residentBlockNumbers_.all(), std::span<const uint32_t>(blockOfSlot_));
  device_.write(groupOfSlot_.all(), std::span<const uint32_t>(groupOfSlot));
}

void VolumeModel::assignSlots(const std::vector<uint32_t>& blockOfSlot) {
  CHECK(blockOfSlot.size() == blockOfSlot_.size());
  const std::vector<uint32_t> before = std::exchange(blockOfSlot_, blockOfSlot);
  for (uint32_t slot = 0; slot < slots(); ++slot) {
    if (blockOfSlot[slot] == before[slot]) continue;
    attributes_.begin(slot, blockOfSlot[slot]);
    proposals_.begin(slot, blockOfSlot[slot]);
  }
  nameSlots();
}

void VolumeModel::readFrom(std::vector<fs::path> files) {
  CHECK(files.size() == space_.blocks());
  files_ = std::move(files);
  restoreDeferred(files_[0], readSafetensors(files_[0]));
  for (const uint32_t block : blockOfSlot_) restoreFields(block, files_[block], readSafetensors(files_[block]));
}

void VolumeModel::ensureResident(const std::vector<uint32_t>& blocks) {
  std::vector<uint32_t> next = blockOfSlot_, missing;
  for (const uint32_t block : blocks) {
    if (findSlot(block) == kNoSlot) missing.push_back(block);
  }
  if (missing.empty()) return;
  CHECK(files_.size() == space_.blocks());
  size_t slot = 0;
  for (const uint32_t block : missing) {
    const auto isRetained = [&](uint32_t resident) {
      return resident >= space_.cells() || std::find(blocks.begin(), blocks.end(), resident) != blocks.end();
    };
    while (slot < next.size() && isRetained(next[slot])) ++slot;
    CHECK(slot < next.size());
    next[slot++] = block;
  }
  assignSlots(next);
  for (const uint32_t block : missing) restoreFields(block, files_[block], readSafetensors(files_[block]));
}

void VolumeModel::copyFields(VolumeModel& from) {
  CHECK(holdsAll());
  CHECK(from.holdsAll());
  CHECK(from.slots() == slots());
  const auto copy = [&](ParameterGroup& to, ParameterGroup& of) {
    device_.write(to.values.all(), std::span<const float>(from.device_.read(of.values.all())));
  };
  for (uint32_t slot = 0; slot < slots(); ++slot) {
    copy(attributes_.table(slot), from.attributes_.table(slot));
    copy(attributes_.network(slot), from.attributes_.network(slot));
    copy(proposals_.table(slot), from.proposals_.table(slot));
    copy(proposals_.network(slot), from.proposals_.network(slot));
  }
}

void VolumeModel::saveFields(uint32_t block, TensorSet& tensors, bool withMoments) {
  const uint32_t slot = findSlot(block);
  CHECK(slot != kNoSlot);
  for (const ParameterGroup* group :
       {&attributes_.table(slot), &attributes_.network(slot), &proposals_.table(slot), &proposals_.network(slot)}) {
    tensors.add(device_, *group, withMoments);
  }
}

void VolumeModel::restoreFields(uint32_t block, const fs::path& path, const Safetensors& file) {
  const uint32_t slot = findSlot(block);
  CHECK(slot != kNoSlot);
  for (ParameterGroup* group :
       {&attributes_.table(slot), &attributes_.network(slot), &proposals_.table(slot), &proposals_.network(slot)}) {
    loadGroup(device_, path, file, *group);
  }
}

void VolumeModel::saveFirstFields(uint32_t block, TensorSet& tensors) const {
  attributes_.saveFirst(block, tensors);
  proposals_.saveFirst(block, tensors);
}

void VolumeModel::save(uint32_t block, TensorSet& tensors, bool withMoments) {
  saveFields(block, tensors, withMoments);
  if (block == 0) saveDeferred(tensors, withMoments);
}

void VolumeModel::restore(uint32_t block, const fs::path& path, const Safetensors& file) {
  restoreFields(block, path, file);
  if (block == 0) restoreDeferred(path, file);
}

}  // namespace tessera
