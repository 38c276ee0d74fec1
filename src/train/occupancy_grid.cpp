#include "train/occupancy_grid.h"

#include <algorithm>
#include <bit>

#include "compute/occupancy.h"

namespace tessera {

OccupancyGrid::OccupancyGrid(Device& device, const MarchSpace& space, Slice<uint32_t> bits)
    : device_(device),
      space_(space),
      cells_(static_cast<uint32_t>(space.gridResolution * space.gridResolution * space.gridResolution)),
      grid_(device.array<float>(cells_)),
      keptBits_(bits) {
  if (!keptBits_) {
    ownBits_ = device.array<uint32_t>(cells_ / 32);
    keptBits_ = ownBits_;
  }
  const std::vector<uint32_t> all(cells_ / 32, ~0u);
  device_.write(keptBits_, std::span<const uint32_t>(all));
}

void OccupancyGrid::exclude(const std::vector<bool>& visible) {
  CHECK(visible.size() == cells_);
  std::vector<float> values = this->values();
  std::vector<uint32_t> bits = bitWords();
  std::vector<uint32_t> candidates;
  for (uint32_t cell = 0; cell < cells_; ++cell) {
    if (visible[cell]) {
      candidates.push_back(cell);
      continue;
    }
    values[cell] = -1;
    bits[cell / 32] &= ~(1u << (cell % 32));
  }
  CHECK(!candidates.empty());
  restore(values, bits);
  candidates_ = device_.uploadArray(candidates);
}

void OccupancyGrid::update(const LogDensity& logDensity, uint32_t uniform, uint32_t occupied, uint64_t seed,
                           uint32_t chunk) {
  const uint32_t points = uniform + occupied;
  if (chosen_.size() < points) {
    chosen_ = device_.array<uint32_t>(points);
    logDensities_ = device_.array<float>(points);
  }
  if (positions_.size() < size_t{chunk} * 3) positions_ = device_.array<float>(size_t{chunk} * 3);
  for (uint32_t first = 0; first < points; first += chunk) {
    const uint32_t count = std::min(chunk, points - first);
    const Slice<float> positions = positions_.part(0, size_t{count} * 3);
    device_.run(OccupancyPoints{space_, uniform, occupied, seed, candidates_, bits(), chosen_.part(first, count),
                                positions, first});
    logDensity({count, {}}, positions, Matrix<float>(logDensities_.part(first, count), 1));
  }
  OccupancyUpdate update{space_};
  update.points = points;
  update.cells = chosen_;
  update.logDensity = Matrix<const float>(logDensities_, 1);
  update.grid = grid_;
  update.occupancy = keptBits_;
  device_.run(update);
}

void OccupancyGrid::fill(float value) {
  std::vector<float> values = this->values();
  for (float& each : values) each = each < 0 ? each : value;
  device_.write(grid_.all(), std::span<const float>(values));
}

void OccupancyGrid::update(float decay, float threshold) {
  OccupancyUpdate update{space_};
  update.decay = decay;
  update.threshold = threshold;
  update.grid = grid_;
  update.occupancy = keptBits_;
  device_.run(update);
}

double OccupancyGrid::occupiedFraction() {
  uint64_t set = 0;
  for (const uint32_t word : bitWords()) set += std::popcount(word);
  return static_cast<double>(set) / cells_;
}

void OccupancyGrid::restore(std::span<const float> values, std::span<const uint32_t> bits) {
  CHECK(values.size() == grid_.size());
  CHECK(bits.size() == keptBits_.count);
  device_.write(grid_.all(), values);
  device_.write(keptBits_, bits);
}

std::vector<uint32_t> dilateCells(std::span<const uint32_t> bits, uint32_t cells) {
  const size_t n = cells, all = n * n * n;
  std::vector<uint8_t> marked(all);
  for (size_t i = 0; i < all; ++i) marked[i] = bits[i / 32] >> i % 32 & 1;
  size_t stride = 1;
  for (int axis = 0; axis < 3; ++axis, stride *= n) {
    const std::vector<uint8_t> before = marked;
    for (size_t i = 0; i < all; ++i) {
      const size_t place = i / stride % n;
      if (place > 0) marked[i] |= before[i - stride];
      if (place + 1 < n) marked[i] |= before[i + stride];
    }
  }
  std::vector<uint32_t> dilated(bits.size());
  for (size_t i = 0; i < all; ++i) dilated[i / 32] |= uint32_t{marked[i]} << i % 32;
  return dilated;
}

}  // namespace tessera
