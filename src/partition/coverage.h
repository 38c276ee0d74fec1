// Which photos and how many of their pixels each block is trained from.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "partition/region.h"
#include "scene/block_grid.h"

namespace tessera {

// How far the ray through a pixel of a photo goes before it ends, in world units along it; 0 where nobody knows.
using DepthOf = std::function<double(int photo, const Vec2d& pixel)>;

struct CellCoverage {
  int photos = 0;            // that see the cell's own square: some ray ends in it
  int64_t pixels = 0;        // of training photos, masks not looked at, whose ray ends in the square
  int64_t pixelsBeyond = 0;  // outside of all squares; the nearest cell owns them
};

// One entry a cell. Rays are tried on a lattice of kCoverageColumns × kCoverageRows a photo and stand for as many
// pixels. Where `depthOf` is missing or says 0 they end on the ground; of cameras that do not look at the ground, where
// they pass the middle of the grid. Rays that never end count nowhere. `depthOf` is called from one thread.
inline constexpr int kCoverageColumns = 48, kCoverageRows = 36;
std::vector<CellCoverage> countCoverage(const Capture& capture, const BlockGrid& grid, const Ground& ground,
                                        bool looksAtGround, const DepthOf& depthOf = {});

struct Sufficiency {
  int photos = kEnoughPhotos;
  int64_t pixels = 512 * 512 / 16;  // a plane's texels / 16
};

struct ThinCell {
  int cell = 0;
  std::string warning;  // a sentence: which, where, how many, what to do
};

// Cells that cannot be trained well: too few photos or pixels.
std::vector<ThinCell> thinCells(const BlockGrid& grid, const std::vector<CellCoverage>& coverage,
                                const Sufficiency& enough);

}  // namespace tessera
