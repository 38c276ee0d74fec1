// Where anything may be, as bits and as distances: what a renderer skips empty space with. Files hold the finest bits;
// everything else is made from them.
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
  explicit OccupancyBits(uint32_t cellsAlongEdge);  // nothing occupied

  size_t count() const { return static_cast<size_t>(cells) * cells * cells; }
  size_t number(uint32_t x, uint32_t y, uint32_t z) const { return x + size_t{cells} * (y + size_t{cells} * z); }
  bool at(size_t number) const { return words[number / 64] >> (number % 64) & 1; }
  bool at(uint32_t x, uint32_t y, uint32_t z) const { return at(number(x, y, z)); }
  void set(size_t number) { words[number / 64] |= uint64_t{1} << (number % 64); }
  bool operator==(const OccupancyBits&) const = default;
};

// Level 0 is the finest. A cell of level k + 1 holds the up to 8 cells of level k below it and is occupied when one of
// them is; it has half as many cells along an edge, rounded up. The last level is one cell.
struct OccupancyPyramid {
  std::vector<OccupancyBits> levels;
};

inline constexpr uint8_t kFarthestDistance = 255;

// The zeros of VolumePart::distances.
OccupancyBits occupancyFromDistances(std::span<const uint8_t> distances, uint32_t cells);
OccupancyPyramid pyramidFromOccupancy(OccupancyBits finest);
OccupancyPyramid pyramidFromDistances(std::span<const uint8_t> distances, uint32_t cells);

// [cells³], x fastest: how many cells away the nearest occupied one is, diagonal steps counting one (Chebyshev); exact
// up to kFarthestDistance, which also stands where there is none. All cells nearer than that number are empty.
// Source: Rosenfeld and Pfaltz, "Distance functions on digital pictures", 1968; two sweeps suffice, because the steps
// of a shortest way may be taken in any order: first those that the first sweep follows, then the others.
std::vector<uint8_t> chebyshevDistances(const OccupancyBits& occupied);

}  // namespace tessera
