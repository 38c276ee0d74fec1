// Occupancy grids as bits and as distances, with which renderers skip empty space. Files hold the finest bits; coarser
// levels and distances are computed from them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

// [cells³] bits, x fastest: cell (x, y, z) is bit n % 64 of word n / 64, n = x + cells (y + cells z).
struct OccupancyBits {
  uint32_t cells = 0;  // along an edge
  std::vector<uint64_t> words;

  OccupancyBits() = default;
  explicit OccupancyBits(uint32_t cellsAlongEdge);  // all cells are empty

  size_t count() const { return static_cast<size_t>(cells) * cells * cells; }
  size_t number(uint32_t x, uint32_t y, uint32_t z) const { return x + size_t{cells} * (y + size_t{cells} * z); }
  bool at(size_t number) const { return words[number / 64] >> (number % 64) & 1; }
  bool at(uint32_t x, uint32_t y, uint32_t z) const { return at(number(x, y, z)); }
  void set(size_t number) { words[number / 64] |= uint64_t{1} << (number % 64); }
  bool operator==(const OccupancyBits&) const = default;
};

// Level 0 is the finest. A cell of level k + 1 covers up to 8 cells of level k and is occupied if one of them is. Each
// level has half as many cells along an edge as the one below, rounded up; the last level has one cell.
struct OccupancyPyramid {
  std::vector<OccupancyBits> levels;
};

inline constexpr uint8_t kFarthestDistance = 255;

// Returns the cells whose distance (VolumePart::distances) is 0 as occupied cells.
OccupancyBits occupancyFromDistances(std::span<const uint8_t> distances, uint32_t cells);
OccupancyPyramid pyramidFromOccupancy(OccupancyBits finest);
OccupancyPyramid pyramidFromDistances(std::span<const uint8_t> distances, uint32_t cells);

// Returns the Chebyshev distance of each cell to the nearest occupied one, in cells (a diagonal step counts one),
// [cells³], x fastest. It is exact up to kFarthestDistance, which also stands for "no cell is occupied". All cells
// nearer than the distance are empty. Source: Rosenfeld and Pfaltz, "Distance functions on digital pictures", 1968. Two
// sweeps suffice, because the steps of a shortest path may be taken in any order: first those along the first sweep,
// then the others.
std::vector<uint8_t> chebyshevDistances(const OccupancyBits& occupied);

}  // namespace tessera
