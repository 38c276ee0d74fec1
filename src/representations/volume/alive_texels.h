// Where something visible stands in a block: what baking keeps (MERF, section 4.3; City-on-Web, section 4.5).
#pragma once

#include <array>
#include <vector>

#include "compute/virtual_grid.h"
#include "tiles/occupancy_pyramid.h"

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

 private:
  VirtualGrid grid_;
  OccupancyBits space_;
  std::array<std::vector<bool>, 3> planes_;
};

}  // namespace tessera
