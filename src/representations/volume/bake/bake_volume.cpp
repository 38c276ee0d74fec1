#include "representations/volume/bake/bake_volume.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr uint32_t kTexels = 1 << 16;  // evaluated in one batch
// Steps of one texel are too long at the edges of roofs where texels are large. With half steps, a level 1 with texels
// of 62 cm was 0.16 dB better (a finest level with texels of 31 cm: 0.03 dB); the steps are still as long as those of
// the level below.
constexpr uint32_t kStepsPerCoarseTexel = 2;
constexpr double kReachOfPlanes = 12.0 / 2048;  // also keeps texels this near to needed ones (MERF: 12 of 2048)

// Evaluates the attributes of a resident block at positions, and quantises them to bytes.
class TexelBaker {
 public:
  TexelBaker(VolumeModel& model, uint32_t block)
      : model_(model), device_(model.device()), slot_(model.findSlot(block)) {
    CHECK(slot_ != kNoSlot);
    batch_ = BlockFieldBatch(device_, model.attributes().shape(), kTexels, false);
    positions_ = device_.array<float>(size_t{3} * kTexels);
    firstOfSlot_ = device_.array<uint32_t>(model.slots() + 1);
    batch_.positions = positions_;
    batch_.firstOfSlot = firstOfSlot_;
    first_.assign(model.slots() + 1, 0);
  }
  // [positions][8]
  std::vector<uint8_t> bytes(const std::vector<float>& positions) {
    std::vector<uint8_t> all;
    all.reserve(positions.size() / 3 * VirtualGrid::kAttributes);
    for (size_t first = 0; first < positions.size() / 3; first += kTexels) {
      const size_t count = std::min<size_t>(kTexels, positions.size() / 3 - first);
      device_.write(positions_.all(), std::span<const float>(positions).subspan(3 * first, 3 * count));
      std::fill(first_.begin() + slot_ + 1, first_.end(), static_cast<uint32_t>(count));
      device_.write(firstOfSlot_.all(), std::span<const uint32_t>(first_));
      model_.attributes().forward(batch_, false);
      for (const float a : device_.read(batch_.outputs.part(0, count * VirtualGrid::kAttributes))) {
        all.push_back(static_cast<uint8_t>(255 * static_cast<double>(a) + 0.5));  // rounds as VirtualGridForward does
      }
    }
    return all;
  }

 private:
  VolumeModel& model_;
  Device& device_;
  uint32_t slot_ = 0;
  BlockFieldBatch batch_;
  Array<float> positions_;
  Array<uint32_t> firstOfSlot_;
  std::vector<uint32_t> first_;
};

void appendPosition(const VirtualGrid& grid, uint32_t texel, std::vector<float>& positions) {
  const std::array<float, 3> position = grid.texelPosition(texel);
  positions.insert(positions.end(), position.begin(), position.end());
}

void bakeVoxels(const VirtualGrid& grid, const OccupiedTexels& occupied, TexelBaker& baker, VolumePart& part) {
  const uint32_t blocks = grid.voxels / VolumePart::kMacroblock;
  const std::vector<bool> needed = occupied.macroblocks();
  part.macroblocks.assign(needed.size(), VolumePart::kEmpty);
  uint32_t stored = 0;
  for (size_t b = 0; b < needed.size(); ++b) {
    if (!needed[b]) continue;
    part.macroblocks[b] = stored++;
    const uint32_t origin[3] = {static_cast<uint32_t>(b % blocks) * VolumePart::kMacroblock,
                                static_cast<uint32_t>(b / blocks % blocks) * VolumePart::kMacroblock,
                                static_cast<uint32_t>(b / blocks / blocks) * VolumePart::kMacroblock};
    std::vector<float> positions;
    for (uint32_t z = 0; z < VolumePart::kStoredEdge; ++z) {
      for (uint32_t y = 0; y < VolumePart::kStoredEdge; ++y) {
        for (uint32_t x = 0; x < VolumePart::kStoredEdge; ++x) {
          const uint32_t last = grid.voxels - 1;
          const uint32_t i = std::min(origin[0] + x, last), j = std::min(origin[1] + y, last),
                         k = std::min(origin[2] + z, last);
          appendPosition(grid, i + grid.voxels * (j + grid.voxels * k), positions);
        }
      }
    }
    const std::vector<uint8_t> bytes = baker.bytes(positions);
    part.voxelBytes.insert(part.voxelBytes.end(), bytes.begin(), bytes.end());
  }
}

void bakePlanes(const VirtualGrid& grid, const OccupiedTexels& occupied, TexelBaker& baker, VolumePart& part) {
  const uint32_t reach = static_cast<uint32_t>(std::ceil(kReachOfPlanes * grid.planes));
  const size_t texels = size_t{grid.planes} * grid.planes;
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<bool> needed = occupied.plane(axis, reach);
    std::vector<float> positions;
    for (uint32_t c = 0; c < grid.planes; ++c) {
      for (uint32_t b = 0; b < grid.planes; ++b) {
        if (needed[size_t{c} * grid.planes + b]) appendPosition(grid, grid.planeTexel(axis, b, c), positions);
      }
    }
    const std::vector<uint8_t> bytes = baker.bytes(positions);
    std::vector<uint8_t>& plane = part.planeBytes[axis];
    plane.assign(texels * VolumePart::kAttributes, 0);
    size_t next = 0;
    for (size_t t = 0; t < texels; ++t) {
      if (!needed[t]) continue;
      std::copy_n(bytes.begin() + static_cast<ptrdiff_t>(next * VolumePart::kAttributes), VolumePart::kAttributes,
                  plane.begin() + static_cast<ptrdiff_t>(t * VolumePart::kAttributes));
      ++next;
    }
  }
}

std::vector<DenseLayer> readDenseLayers(VolumeModel& model, uint32_t group) {
  constexpr uint32_t kSizes[] = {DeferredNetwork::kInputs, DeferredNetwork::kHidden, DeferredNetwork::kHidden, 3};
  const std::vector<float> all = model.device().read(
      model.deferred().values.part(size_t{group} * DeferredNetwork::kParameters, DeferredNetwork::kParameters));
  std::vector<DenseLayer> layers;
  for (int l = 0; l < 3; ++l) {
    DenseLayer layer{kSizes[l], kSizes[l + 1], {}, {}};
    const auto weights = all.begin() + DeferredNetwork::kWeights[l];
    const auto biases = weights + layer.inputs * layer.outputs;
    layer.weights.assign(weights, biases);
    layer.biases.assign(biases, biases + layer.outputs);
    layers.push_back(std::move(layer));
  }
  return layers;
}

}  // namespace

VolumePart bakePart(VolumeModel& model, uint32_t block, const OccupiedTexels& occupied) {
  const VirtualGrid& grid = model.virtualGrid();
  const BlockSpace& space = model.space();
  VolumePart part;
  const BlockSpace::Placement placement = space.placement(block);
  std::copy_n(placement.centre, 3, part.centre.begin());
  std::copy_n(placement.scale, 3, part.scale.begin());
  part.contracted = placement.contracted;
  part.backgroundBlock = block >= space.cells();
  const BlockSpace::Box owned = space.owned(block);
  part.low = owned.low;
  part.high = owned.high;
  part.voxels = grid.voxels;
  part.planes = grid.planes;
  TexelBaker baker(model, block);
  bakeVoxels(grid, occupied, baker, part);
  bakePlanes(grid, occupied, baker, part);
  part.distances = chebyshevDistances(occupied.occupancy(grid.planes / VolumePart::kDistanceCell));
  return part;
}

VolumeContent bakeGroup(VolumeModel& model, uint32_t group, const std::vector<OccupiedTexels>& occupied) {
  VolumeContent content;
  content.featureRange = model.virtualGrid().featureRange;
  if (model.config().lod > 0) content.stepsPerTexel = kStepsPerCoarseTexel;
  content.densityRange = model.virtualGrid().densityRange;
  content.network = readDenseLayers(model, group);
  for (uint32_t block = 0; block < model.space().blocks(); ++block) {
    if (model.groups().groupOfBlock[block] != group) continue;
    model.ensureResident({block});
    content.parts.push_back(bakePart(model, block, occupied[block]));
  }
  return content;
}

}  // namespace tessera
