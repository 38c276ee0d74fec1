// Divides training photos into tiles and finds the blocks that are visible through each tile. A scene that is trained
// with only some blocks in memory (City-on-Web) draws its rays from the tiles whose blocks are all resident.
#pragma once

#include "compute/blocks.h"
#include "train/sparse_depth.h"

namespace tessera {

// Pixels [left, right) × [top, bottom).
struct PhotoTile {
  int photo = 0;
  uint32_t left = 0, top = 0, right = 1, bottom = 1;
};

struct TiledPhotos {
  std::vector<PhotoTile> tiles;             // grouped by photo
  std::vector<uint32_t> setOfTile;          // [tiles], index into sets
  std::vector<std::vector<uint32_t>> sets;  // distinct; increasing block numbers, without a separate background block
};

// Returns the grid cells that a ray crosses between its entry into the region's box and the distance `farthest` (scene
// units), in the order in which it crosses them. What lies outside the box is ignored, whichever block represents it.
std::vector<uint32_t> cellsAlong(const BlockSpace& space, const Vec3d& origin, const Vec3d& direction, double farthest);

// Divides each training photo into approximately square tiles, at most kTilesAcross along its longer edge. The blocks
// of a tile are those that kRaysAcrossTile² rays, spread over the tile including its corners, cross up to its coarse
// depth: kDepthSlack times the farthest sparse depth in it and its neighbours if these hold at least kEnoughKnown
// sparse depths, else the point where rays leave the box. (A ray between these may still cut the corner of another
// block over a fraction of a tile's width.)
inline constexpr uint32_t kTilesAcross = 32, kRaysAcrossTile = 5;
inline constexpr double kDepthSlack = 1.2;
inline constexpr size_t kEnoughKnown = 8;
TiledPhotos tilePhotos(const Capture& capture, const SceneFrame& frame, const BlockSpace& space);

// The tiles that rays are drawn from in one photo, with the running sum of their shares.
struct TileShares {
  std::vector<PhotoTile> tiles;  // of a lattice, row by row
  std::vector<double> until;

  double total() const { return until.empty() ? 0 : until.back(); }
};
// Returns [photoCount] shares. A tile's share is `shareOfSet` of its set; tiles of share 0 are left out.
std::vector<TileShares> computeTileShares(const TiledPhotos& photos, const std::vector<double>& shareOfSet,
                                          size_t photoCount);

}  // namespace tessera
