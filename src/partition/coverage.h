// The number of photos, and of their pixels, that each block is trained on.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "partition/region.h"
#include "scene/block_grid.h"

namespace tessera {

// Returns the length of the ray through a pixel of a photo up to the surface, in world units along the ray; 0 where it
// is unknown.
using DepthOf = std::function<double(int photo, const Vec2d& pixel)>;

struct CellCoverage {
  int photos = 0;            // training photos with a ray that ends in the cell's square
  int64_t pixels = 0;        // pixels of training photos whose ray ends in the square; masks are not considered
  int64_t pixelsBeyond = 0;  // pixels whose ray ends outside all squares, counted for the nearest cell
};

// Returns one entry per cell. Rays are cast on a lattice of kCoverageColumns × kCoverageRows per photo, and each stands
// for an equal share of the photo's pixels. Where `findRayDepth` is missing or returns 0, a ray ends on the ground, or,
// if the cameras do not look at the ground, where it passes the centre of the grid. Rays that never end are not
// counted. `findRayDepth` is called from a single thread.
inline constexpr int kCoverageColumns = 48, kCoverageRows = 36;
std::vector<CellCoverage> countCoverage(const Capture& capture, const BlockGrid& grid, const Ground& ground,
                                        bool looksAtGround, const DepthOf& findRayDepth = {});

struct CoverageThresholds {
  int photos = kEnoughPhotos;
  int64_t pixels = 512 * 512 / 16;  // a plane's texels / 16
};

struct ThinCell {
  int cell = 0;
  std::string warning;  // a sentence: which cell, its position, its counts, the remedy
};

// Returns the cells with too few photos or pixels to be trained well, in order of cell.
std::vector<ThinCell> thinCells(const BlockGrid& grid, const std::vector<CellCoverage>& coverage,
                                const CoverageThresholds& enough);

}  // namespace tessera
