#include "representations/volume/bake/occupied_texels.h"

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

// Returns the cell of a grid of `to` cells that contains the centre of cell `i` of a grid of `from` cells.
uint32_t cellOfMiddle(uint32_t i, uint32_t from, uint32_t to) {
  return static_cast<uint32_t>((2 * uint64_t{i} + 1) * to / (2 * uint64_t{from}));
}

// Dilates the marks by `reach` along a line of `count` bits that are `stride` apart.
void spread(std::vector<bool>& bits, size_t first, size_t count, size_t stride, uint32_t reach) {
  std::vector<bool> line(count);
  for (size_t i = 0; i < count; ++i) line[i] = bits[first + i * stride];
  size_t until = 0;
  for (size_t i = 0; i < count + reach; ++i) {  // towards higher indices; the loop below goes the other way
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

OccupiedTexels::OccupiedTexels(const VirtualGrid& grid)
    : grid_(grid),
      cells_(std::min(grid.planes, kMaxCells)),
      bricksAlong_((cells_ + kBrickEdge - 1) / kBrickEdge),
      brickAt_(size_t{bricksAlong_} * bricksAlong_ * bricksAlong_) {
  for (std::vector<bool>& plane : planes_) plane.resize(size_t{grid.planes} * grid.planes);
}

size_t OccupiedTexels::bytes() const {
  return brickAt_.size() * sizeof(uint32_t) + bricks_.size() * sizeof(uint64_t) +
         size_t{3} * grid_.planes * grid_.planes / 8;
}

void OccupiedTexels::markCell(uint32_t x, uint32_t y, uint32_t z) {
  uint32_t& number =
      brickAt_[x / kBrickEdge + size_t{bricksAlong_} * (y / kBrickEdge + size_t{bricksAlong_} * (z / kBrickEdge))];
  if (number == 0) {
    bricks_.resize(bricks_.size() + kWordsOfBrick);
    number = static_cast<uint32_t>(bricks_.size() / kWordsOfBrick);
  }
  const uint32_t bit = x % kBrickEdge + kBrickEdge * (y % kBrickEdge + kBrickEdge * (z % kBrickEdge));
  bricks_[size_t{number - 1} * kWordsOfBrick + bit / 64] |= uint64_t{1} << (bit % 64);
}

void OccupiedTexels::mark(const float position[3]) {
  Around cells[3], texels[3];
  for (int a = 0; a < 3; ++a) {
    cells[a] = texelsAround(position[a], cells_);
    texels[a] = texelsAround(position[a], grid_.planes);
  }
  for (int c = 0; c < 8; ++c) {
    markCell(c & 1 ? cells[0].high : cells[0].low, c & 2 ? cells[1].high : cells[1].low,
             c & 4 ? cells[2].high : cells[2].low);
  }
  for (int a = 0; a < 3; ++a) {
    const Around &b = texels[a == 0 ? 1 : 0], &c = texels[a == 2 ? 1 : 2];
    for (const uint32_t row : {c.low, c.high}) {
      for (const uint32_t column : {b.low, b.high}) planes_[a][size_t{row} * grid_.planes + column] = true;
    }
  }
}

std::vector<bool> OccupiedTexels::macroblocks() const {
  constexpr uint32_t kEdge = 8;
  const uint32_t blocks = grid_.voxels / kEdge;
  std::vector<bool> occupied(size_t{blocks} * blocks * blocks);
  const OccupancyBits voxels = occupancy(grid_.voxels);
  const auto holding = [&](uint32_t voxel) {  // the macroblocks that store it: its own, and by its apron the one below
    return Around{voxel % kEdge == 0 && voxel > 0 ? voxel / kEdge - 1 : voxel / kEdge, voxel / kEdge};
  };
  for (uint32_t z = 0; z < grid_.voxels; ++z) {
    for (uint32_t y = 0; y < grid_.voxels; ++y) {
      for (uint32_t x = 0; x < grid_.voxels; ++x) {
        if (!voxels.at(x, y, z)) continue;
        const Around bx = holding(x), by = holding(y), bz = holding(z);
        for (uint32_t k = bz.low; k <= bz.high; ++k) {
          for (uint32_t j = by.low; j <= by.high; ++j) {
            for (uint32_t i = bx.low; i <= bx.high; ++i) occupied[i + size_t{blocks} * (j + size_t{blocks} * k)] = true;
          }
        }
      }
    }
  }
  return occupied;
}

OccupancyBits OccupiedTexels::occupancy(uint32_t cells) const {
  OccupancyBits pooled(cells);
  for (size_t at = 0; at < brickAt_.size(); ++at) {
    if (brickAt_[at] == 0) continue;
    const uint64_t* words = &bricks_[size_t{brickAt_[at] - 1} * kWordsOfBrick];
    const uint32_t first[3] = {static_cast<uint32_t>(at % bricksAlong_) * kBrickEdge,
                               static_cast<uint32_t>(at / bricksAlong_ % bricksAlong_) * kBrickEdge,
                               static_cast<uint32_t>(at / bricksAlong_ / bricksAlong_) * kBrickEdge};
    for (uint32_t bit = 0; bit < 64 * kWordsOfBrick; ++bit) {
      if (!(words[bit / 64] >> (bit % 64) & 1)) continue;
      const uint32_t x = first[0] + bit % kBrickEdge, y = first[1] + bit / kBrickEdge % kBrickEdge,
                     z = first[2] + bit / kBrickEdge / kBrickEdge;
      pooled.set(pooled.number(cellOfMiddle(x, cells_, cells), cellOfMiddle(y, cells_, cells),
                               cellOfMiddle(z, cells_, cells)));
    }
  }
  return pooled;
}

std::vector<bool> OccupiedTexels::plane(int axis, uint32_t reach) const {
  std::vector<bool> bits = planes_[axis];
  const size_t n = grid_.planes;
  for (size_t row = 0; row < n; ++row) spread(bits, row * n, n, 1, reach);
  for (size_t column = 0; column < n; ++column) spread(bits, column, n, n, reach);
  return bits;
}

}  // namespace tessera
