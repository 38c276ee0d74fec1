// An occupancy grid on the device: which cells of the scene are not empty. It is updated from the field as in
// instant-ngp.
#pragma once

#include <functional>

#include "compute/device.h"
#include "compute/rays.h"

namespace tessera {

class OccupancyGrid {
 public:
  // Every cell starts occupied. `bits`: external storage of the occupancy bits, [cells / 32]; without it the grid
  // allocates its own. Keeps a reference to `device`.
  OccupancyGrid(Device& device, const MarchSpace& space, Slice<uint32_t> bits = {});
  // Cells that are not `visible` (see visibleCells; [cells], at least one is visible) become empty and remain so.
  void exclude(const std::vector<bool>& visible);

  // Writes the log density, 1 column, at `count` positions ([count][3], grid coordinates).
  using LogDensity = std::function<void(Count count, Slice<const float> positions, Matrix<float> logDensities)>;

  // Performs one update at `uniform` random and `occupied` occupied cells (at all cells if uniform is visibleCells()),
  // evaluating `chunk` points at a time.
  void update(const LogDensity& logDensity, uint32_t uniform, uint32_t occupied, uint64_t seed, uint32_t chunk);

  // The values of the cells, to be raised by OccupancySamples; [cells].
  Slice<float> raisedBySamples() { return grid_; }
  // Sets all values that exclude() has not made negative.
  void fill(float value);
  // Lets the values decay, and sets the bits of those above min(threshold, mean).
  void update(float decay, float threshold);

  uint32_t cells() const { return cells_; }
  Slice<const uint32_t> bits() const { return keptBits_; }
  // Cells that exclude() has not removed.
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
  Array<float> positions_;  // [chunk][3]
  Array<float> logDensities_;
};

// Returns the cells of a grid, bits of [cells³], that are set or have a neighbour that is, diagonal ones included.
std::vector<uint32_t> dilateCells(std::span<const uint32_t> bits, uint32_t cells);

}  // namespace tessera
