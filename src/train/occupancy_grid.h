// Which cells of the scene may hold anything: kept on the device, refreshed from the field as instant-ngp does.
#pragma once

#include <functional>

#include "compute/device.h"
#include "compute/rays.h"

namespace tessera {

class OccupancyGrid {
 public:
  // Every cell starts occupied, but those that `visible` says no (see visibleCells): they stay empty for good. `bits`:
  // where they are kept, [cells / 32]; else the grid has room of its own.
  OccupancyGrid(Device& device, const MarchSpace& space, Slice<uint32_t> bits = {});
  void exclude(const std::vector<bool>& visible);  // at least one is

  // Writes log density, 1 column, at `count` positions ([count][3], grid coordinates).
  using LogDensity = std::function<void(Count count, Slice<const float> positions, Matrix<float> logDensities)>;

  // One refresh of `uniform` random and `occupied` occupied cells (or all, with uniform = visibleCells), `chunk` points
  // at a time.
  void update(const LogDensity& logDensity, uint32_t uniform, uint32_t occupied, uint64_t seed, uint32_t chunk);

  uint32_t cells() const { return cells_; }
  Slice<const uint32_t> bits() const { return keptBits_; }
  uint32_t visibleCells() const { return candidates_.size() ? static_cast<uint32_t>(candidates_.size()) : cells_; }
  double occupiedFraction();

  std::vector<float> values() { return device_.read(grid_.all()); }
  void restore(std::span<const float> values, std::span<const uint32_t> bits);
  std::vector<uint32_t> bitWords() { return device_.read(bits()); }

 private:
  Device& device_;
  MarchSpace space_;
  uint32_t cells_;
  Array<float> grid_;
  Array<uint32_t> ownBits_;
  Slice<uint32_t> keptBits_;
  Array<uint32_t> candidates_;  // the visible cells, unless all are
  Array<uint32_t> chosen_;
  Array<float> positions_;  // of one chunk
  Array<float> logDensities_;
};

}  // namespace tessera
