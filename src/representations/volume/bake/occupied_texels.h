// The parts of a block in which something is visible; baking keeps only these (MERF, section 4.3; City-on-Web, section
// 4.5). It stores one bit for each texel of the three planes (planes of 512²: 96 KiB, 2048²: 1.5 MiB) and, for the
// block's volume, 512 bytes for each brick of 16³ cells in which a cell is marked: about 1 MiB where there are
// surfaces, never more than 16 MiB. Baking holds those of all blocks in memory.
#pragma once

#include <array>
#include <vector>

#include "compute/virtual_grid.h"
#include "raymarch/content/occupancy_pyramid.h"

namespace tessera {

class OccupiedTexels {
 public:
  // The largest number of cells along an edge of the volume; where planes are finer, four or more texels share a bit.
  static constexpr uint32_t kMaxCells = 512;

  explicit OccupiedTexels(const VirtualGrid& grid);

  // Marks the texels around a visible sample, at a position in [0,1]³, as needed.
  void mark(const float position[3]);

  // Returns which macroblocks contain a needed voxel, apron included, [(voxels / 8)³], x fastest.
  std::vector<bool> macroblocks() const;
  OccupancyBits occupancy(uint32_t cells) const;  // `cells` along an edge, at most `planes`
  // Returns the needed texels of a plane and those up to `reach` texels beside them, [planes²], row c, column b.
  std::vector<bool> plane(int axis, uint32_t reach) const;

  size_t bytes() const;  // in memory

 private:
  static constexpr uint32_t kBrickEdge = 16, kWordsOfBrick = kBrickEdge * kBrickEdge * kBrickEdge / 64;
  void markCell(uint32_t x, uint32_t y, uint32_t z);

  VirtualGrid grid_;
  uint32_t cells_ = 0, bricksAlong_ = 0;
  std::vector<uint32_t> brickAt_;  // [bricksAlong³], x fastest: 1 + the index of the brick, 0 if it has none
  std::vector<uint64_t> bricks_;   // [bricks][kWordsOfBrick], x fastest
  std::array<std::vector<bool>, 3> planes_;
};

}  // namespace tessera
