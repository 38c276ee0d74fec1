// Training photos cut into tiles, and which blocks one sees through each: a scene that is trained a few blocks at a
// time (City-on-Web) draws its rays from those tiles whose blocks are all in memory.
#pragma once

#include "compute/blocks.h"
#include "train/known_distances.h"

namespace tessera {

// Pixels [left, right) × [top, bottom).
struct PhotoTile {
  int photo = 0;
  uint32_t left = 0, top = 0, right = 1, bottom = 1;
};

struct TiledPhotos {
  std::vector<PhotoTile> tiles;             // photo after photo
  std::vector<uint32_t> setOfTile;          // [tiles]
  std::vector<std::vector<uint32_t>> sets;  // distinct; block numbers, increasing, without an own surround
};

// The cells that a ray passes between where it enters the box and `farthest`, in its order; scene units. Nothing
// beyond the box, whoever owns that.
std::vector<uint32_t> cellsAlong(const BlockSpace& space, const Vec3d& origin, const Vec3d& direction, double farthest);

// Of the training photos: each is cut into at most kTilesAcross tiles along its longer edge, about square. A tile's
// blocks are those of kRaysAcrossTile² rays spread over it to its very corners, up to its coarse depth: kDepthSlack
// times the farthest known distance in it and its neighbours where they hold kEnoughKnown, else where rays leave the
// box. (A ray between may still cut the corner of another block for a fraction of a tile's width.)
inline constexpr uint32_t kTilesAcross = 32, kRaysAcrossTile = 5;
inline constexpr double kDepthSlack = 1.2;
inline constexpr size_t kEnoughKnown = 8;
TiledPhotos tilePhotos(const Capture& capture, const SceneFrame& frame, const BlockSpace& space);

// Where rays may be drawn from in one photo: tile after tile, with the running sum of their shares.
struct TileShares {
  std::vector<PhotoTile> tiles;
  std::vector<double> until;

  double total() const { return until.empty() ? 0 : until.back(); }
};
// [photo] of `photos`. A tile's share is `shareOfSet` of its set; those of share 0 are left out.
std::vector<TileShares> sharesOf(const TiledPhotos& photos, const std::vector<double>& shareOfSet, size_t photoCount);

}  // namespace tessera
