// Where something visible stands in a block: what baking keeps (MERF, section 4.3; City-on-Web, section 4.5). A bit for
// each texel of the three planes (planes of 512²: 96 KiB, 2048²: 1.5 MiB), and for space 512 bytes for each 16³ cells
// in which anything is marked: about 1 MiB where there are surfaces, never more than 16. Baking keeps those of all
// blocks.
#pragma once

#include <array>
#include <vector>

#include "compute/virtual_grid.h"
#include "raymarch/content/occupancy_pyramid.h"

namespace tessera {

class AliveTexels {
 public:
  // Of planes finer than this, four texels and more share a bit of space.
  static constexpr uint32_t kMostCells = 512;

  explicit AliveTexels(const VirtualGrid& grid);

  // A visible sample at a position in [0,1]³: the texels around it are needed.
  void mark(const float position[3]);

  // [(voxels / 8)³], x fastest: which macroblocks have a voxel, or a voxel of the apron, that is needed.
  std::vector<bool> macroblocks() const;
  OccupancyBits occupancy(uint32_t cells) const;  // cells along an edge, no more than `planes`
  // [planes²], row c, column b: texels that are needed, and those up to `reach` texels beside them.
  std::vector<bool> plane(int axis, uint32_t reach) const;

  size_t bytes() const;  // that it takes

 private:
  static constexpr uint32_t kBrickEdge = 16, kWordsOfBrick = kBrickEdge * kBrickEdge * kBrickEdge / 64;
  void markCell(uint32_t x, uint32_t y, uint32_t z);

  VirtualGrid grid_;
  uint32_t cells_ = 0, bricksAlong_ = 0;
  std::vector<uint32_t> brickAt_;  // [bricksAlong³], x fastest: 1 + its number, 0 where nothing is marked
  std::vector<uint64_t> bricks_;   // [bricks][kWordsOfBrick], x fastest
  std::array<std::vector<bool>, 3> planes_;
};

}  // namespace tessera
