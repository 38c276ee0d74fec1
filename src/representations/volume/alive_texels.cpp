#include "representations/volume/alive_texels.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

struct Around {
  uint32_t low, high;
};

Around texelsAround(float position, uint32_t resolution) {
  const double low = std::floor(static_cast<double>(position) * resolution - 0.5), last = resolution - 1.0;
  return {static_cast<uint32_t>(std::clamp(low, 0.0, last)), static_cast<uint32_t>(std::clamp(low + 1, 0.0, last))};
}

// The cell of one grid in which the middle of a cell of another lies.
uint32_t cellOfMiddle(uint32_t i, uint32_t from, uint32_t to) {
  return static_cast<uint32_t>((2 * uint64_t{i} + 1) * to / (2 * uint64_t{from}));
}

// For each marked bit, its neighbours up to `reach` away along a line of `count` bits `stride` apart.
void spread(std::vector<bool>& bits, size_t first, size_t count, size_t stride, uint32_t reach) {
  std::vector<bool> line(count);
  for (size_t i = 0; i < count; ++i) line[i] = bits[first + i * stride];
  size_t until = 0;
  for (size_t i = 0; i < count + reach; ++i) {  // marks reach backward and forward
    if (i < count && line[i]) until = i + reach + 1;
    if (i < count && i < until) bits[first + i * stride] = true;
  }
  until = 0;
  for (size_t i = 0; i < count; ++i) {
    const size_t at = count - 1 - i;
    if (line[at]) until = i + reach + 1;
    if (i < until) bits[first + at * stride] = true;
  }
}

}  // namespace

AliveTexels::AliveTexels(const VirtualGrid& grid) : grid_(grid), space_(std::min(grid.planes, kMostCells)) {
  for (std::vector<bool>& plane : planes_) plane.resize(size_t{grid.planes} * grid.planes);
}

void AliveTexels::mark(const float position[3]) {
  Around cells[3], texels[3];
  for (int a = 0; a < 3; ++a) {
    cells[a] = texelsAround(position[a], space_.cells);
    texels[a] = texelsAround(position[a], grid_.planes);
  }
  for (int c = 0; c < 8; ++c) {
    space_.set(space_.number(c & 1 ? cells[0].high : cells[0].low, c & 2 ? cells[1].high : cells[1].low,
                             c & 4 ? cells[2].high : cells[2].low));
  }
  for (int a = 0; a < 3; ++a) {
    const Around &b = texels[a == 0 ? 1 : 0], &c = texels[a == 2 ? 1 : 2];
    for (const uint32_t row : {c.low, c.high}) {
      for (const uint32_t column : {b.low, b.high}) planes_[a][size_t{row} * grid_.planes + column] = true;
    }
  }
}

std::vector<bool> AliveTexels::macroblocks() const {
  constexpr uint32_t kEdge = 8;
  const uint32_t blocks = grid_.voxels / kEdge;
  std::vector<bool> alive(size_t{blocks} * blocks * blocks);
  const OccupancyBits voxels = occupancy(grid_.voxels);
  const auto holding = [&](uint32_t voxel) {  // the macroblocks that have it: its own, and below it by its apron
    return Around{voxel % kEdge == 0 && voxel > 0 ? voxel / kEdge - 1 : voxel / kEdge, voxel / kEdge};
  };
  for (uint32_t z = 0; z < grid_.voxels; ++z) {
    for (uint32_t y = 0; y < grid_.voxels; ++y) {
      for (uint32_t x = 0; x < grid_.voxels; ++x) {
        if (!voxels.at(x, y, z)) continue;
        const Around bx = holding(x), by = holding(y), bz = holding(z);
        for (uint32_t k = bz.low; k <= bz.high; ++k) {
          for (uint32_t j = by.low; j <= by.high; ++j) {
            for (uint32_t i = bx.low; i <= bx.high; ++i) alive[i + size_t{blocks} * (j + size_t{blocks} * k)] = true;
          }
        }
      }
    }
  }
  return alive;
}

OccupancyBits AliveTexels::occupancy(uint32_t cells) const {
  OccupancyBits pooled(cells);
  const uint32_t n = space_.cells;
  for (size_t word = 0; word < space_.words.size(); ++word) {
    if (space_.words[word] == 0) continue;
    for (size_t number = word * 64; number < std::min(space_.count(), (word + 1) * 64); ++number) {
      if (!space_.at(number)) continue;
      const uint32_t x = static_cast<uint32_t>(number % n), y = static_cast<uint32_t>(number / n % n),
                     z = static_cast<uint32_t>(number / n / n);
      pooled.set(pooled.number(cellOfMiddle(x, n, cells), cellOfMiddle(y, n, cells), cellOfMiddle(z, n, cells)));
    }
  }
  return pooled;
}

std::vector<bool> AliveTexels::plane(int axis, uint32_t reach) const {
  std::vector<bool> bits = planes_[axis];
  const size_t n = grid_.planes;
  for (size_t row = 0; row < n; ++row) spread(bits, row * n, n, 1, reach);
  for (size_t column = 0; column < n; ++column) spread(bits, column, n, n, reach);
  return bits;
}

}  // namespace tessera
