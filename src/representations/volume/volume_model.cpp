#include "representations/volume/volume_model.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/random.h"

namespace tessera {
namespace {

Device& able(Device& device, const VolumeConfig& config) {
  config.check();
  requireAllOperations(device);
  return device;
}

// Xavier weights, biases 0. The last bias is low, so that diffuse colours come first.
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

}  // namespace

SceneFrame sceneFrameOf(const BlockGrid& grid) {
  SceneFrame frame;
  frame.centre = grid.inWorld({0, 0, (grid.bottom + grid.top) / 2});
  frame.rotation = grid.gridFromWorld;
  frame.scale = 2 / grid.edge;
  return frame;
}

BlockSpace blockSpaceOf(const BlockGrid& grid, const VolumeConfig& config) {
  BlockSpace space;
  space.columns = static_cast<uint32_t>(grid.columns);
  space.rows = static_cast<uint32_t>(grid.rows);
  space.top = static_cast<float>((grid.top - grid.bottom) / grid.edge);
  space.bottom = -space.top;
  space.near = static_cast<float>(config.near);
  space.surround = config.surroundKind();
  return space;
}

VolumeModel::VolumeModel(Device& device, const VolumeConfig& config, const BlockGrid& grid)
    : device_(able(device, config)),
      config_(config),
      grid_(grid),
      frame_(sceneFrameOf(grid)),
      space_(blockSpaceOf(grid, config)),
      virtualGrid_(config.virtualGrid()),
      groups_(groupsOfLevel(space_.columns, space_.rows, static_cast<uint32_t>(config.level),
                            space_.blocks() > space_.cells())),
      groupOfBlock_(device.arrayOf(groups_.groupOfBlock)),
      attributes_(device, "attributes", config.attributeShape(), space_.blocks(),
                  mix64(static_cast<uint64_t>(config.seed))),
      proposals_(device, "proposals", config.proposalShape(), space_.blocks(),
                 mix64(static_cast<uint64_t>(config.seed) + 1)),
      deferred_(device, "deferred", initialDeferred(groups_.groups(), static_cast<uint64_t>(config.seed))) {
  if (config.shareTexels || space_.blocks() == 1) return;
  throw Error("--set share_texels=false", "", "is for models of one block",
              "leave it at true, or use --blocks 1x1 and --set surround=border");
}

void VolumeModel::copyFields(VolumeModel& from) {
  const auto copy = [&](ParameterGroup& to, ParameterGroup& of) {
    device_.write(to.values.all(), std::span<const float>(from.device_.read(of.values.all())));
  };
  CHECK(from.space_.blocks() == space_.blocks());
  for (uint32_t block = 0; block < space_.blocks(); ++block) {
    copy(attributes_.table(block), from.attributes_.table(block));
    copy(attributes_.network(block), from.attributes_.network(block));
    copy(proposals_.table(block), from.proposals_.table(block));
    copy(proposals_.network(block), from.proposals_.network(block));
  }
}

void VolumeModel::save(uint32_t block, TensorSet& tensors, bool withMoments) {
  for (const ParameterGroup* group :
       {&attributes_.table(block), &attributes_.network(block), &proposals_.table(block), &proposals_.network(block)}) {
    tensors.add(device_, *group, withMoments);
  }
  if (block == 0) tensors.add(device_, deferred_, withMoments);
}

void VolumeModel::restore(uint32_t block, const fs::path& path, const Safetensors& file) {
  for (ParameterGroup* group :
       {&attributes_.table(block), &attributes_.network(block), &proposals_.table(block), &proposals_.network(block)}) {
    loadGroup(device_, path, file, *group);
  }
  if (block == 0) loadGroup(device_, path, file, deferred_);
}

}  // namespace tessera
