#include "train/photo_tiles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "base/threads.h"

namespace tessera {
namespace {

struct TileCounts {
  uint32_t columns, rows;

  explicit TileCounts(const Camera& camera) {
    const uint32_t width = static_cast<uint32_t>(camera.width), height = static_cast<uint32_t>(camera.height);
    const uint32_t edge = std::max(1u, (std::max(width, height) + kTilesAcross - 1) / kTilesAcross);
    columns = (width + edge - 1) / edge;
    rows = (height + edge - 1) / edge;
  }
  PhotoTile tile(const Camera& camera, int photo, uint32_t i, uint32_t j) const {
    const uint32_t width = static_cast<uint32_t>(camera.width), height = static_cast<uint32_t>(camera.height);
    return {photo, width * i / columns, height * j / rows, width * (i + 1) / columns, height * (j + 1) / rows};
  }
};

// Returns the coarse depth of each tile of a photo, see tilePhotos.
std::vector<double> coarseDepths(const Camera& camera, const TileCounts& counts,
                                 const std::vector<SparseDepth>& known) {
  const size_t all = size_t{counts.columns} * counts.rows;
  std::vector<size_t> observations(all);
  std::vector<double> farthest(all);
  for (const SparseDepth& each : known) {
    const size_t i = size_t{each.x} * counts.columns / static_cast<uint32_t>(camera.width);
    const size_t j = size_t{each.y} * counts.rows / static_cast<uint32_t>(camera.height);
    const size_t tile = i + counts.columns * j;
    ++observations[tile];
    farthest[tile] = std::max(farthest[tile], static_cast<double>(each.distance));
  }
  std::vector<double> depths(all);
  for (uint32_t j = 0; j < counts.rows; ++j) {
    for (uint32_t i = 0; i < counts.columns; ++i) {
      size_t near = 0;
      double depth = 0;
      for (uint32_t y = j > 0 ? j - 1 : 0; y < std::min(j + 2, counts.rows); ++y) {
        for (uint32_t x = i > 0 ? i - 1 : 0; x < std::min(i + 2, counts.columns); ++x) {
          near += observations[x + size_t{counts.columns} * y];
          depth = std::max(depth, farthest[x + size_t{counts.columns} * y]);
        }
      }
      depths[i + size_t{counts.columns} * j] =
          near >= kEnoughKnown ? kDepthSlack * depth : std::numeric_limits<double>::infinity();
    }
  }
  return depths;
}

std::vector<uint32_t> cellsBehind(const PhotoTile& tile, const Capture& capture, const SceneFrame& frame,
                                  const BlockSpace& space, double depth) {
  const Photo& photo = capture.photos[tile.photo];
  const Camera& camera = capture.cameras[photo.camera];
  const Vec3d origin = frame.sceneFromWorld(photo.worldFromCamera.translation);
  const Vec2d from(tile.left, tile.top), size(tile.right - tile.left, tile.bottom - tile.top);
  std::set<uint32_t> cells;
  for (uint32_t j = 0; j < kRaysAcrossTile; ++j) {
    for (uint32_t i = 0; i < kRaysAcrossTile; ++i) {
      const auto inCamera = camera.directionInCamera(from + size.cwiseProduct(Vec2d(i, j)) / (kRaysAcrossTile - 1));
      if (!inCamera) continue;
      const Vec3d direction = frame.rotation * (photo.worldFromCamera.rotation * inCamera->normalized());
      const std::vector<uint32_t> along = cellsAlong(space, origin, direction, depth);
      cells.insert(along.begin(), along.end());
    }
  }
  return {cells.begin(), cells.end()};
}

}  // namespace

std::vector<uint32_t> cellsAlong(const BlockSpace& space, const Vec3d& origin, const Vec3d& direction,
                                 double farthest) {
  const Vec3d low(-1.0 * space.columns, -1.0 * space.rows, space.bottom);
  const Vec3d high(1.0 * space.columns, 1.0 * space.rows, space.top);
  double enter = 0, leave = farthest;
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) {
      if (origin[axis] < low[axis] || origin[axis] > high[axis]) return {};
      continue;
    }
    const double toLow = (low[axis] - origin[axis]) / direction[axis],
                 toHigh = (high[axis] - origin[axis]) / direction[axis];
    enter = std::max(enter, std::min(toLow, toHigh));
    leave = std::min(leave, std::max(toLow, toHigh));
  }
  if (!(enter < leave)) return {};
  std::vector<double> ends{enter, leave};
  for (const int axis : {0, 1}) {
    if (direction[axis] == 0) continue;
    const int cells = static_cast<int>(axis == 0 ? space.columns : space.rows);
    for (int wall = 2 - cells; wall < cells; wall += 2) {
      const double t = (wall - origin[axis]) / direction[axis];
      if (t > enter && t < leave) ends.push_back(t);
    }
  }
  std::sort(ends.begin(), ends.end());
  std::vector<uint32_t> cells;
  for (size_t i = 0; i + 1 < ends.size(); ++i) {
    const Vec3d x = origin + (ends[i] + ends[i + 1]) / 2 * direction;
    // The point is clamped to the box, so that rounding does not assign the last interval to a background block.
    const double z = std::clamp<double>(x.z(), space.bottom, space.top);
    const uint32_t cell = space.blockAt(std::clamp(x.x(), low.x(), high.x()), std::clamp(x.y(), low.y(), high.y()), z);
    if (cells.empty() || cells.back() != cell) cells.push_back(cell);
  }
  return cells;
}

TiledPhotos tilePhotos(const Capture& capture, const SceneFrame& frame, const BlockSpace& space) {
  const std::vector<std::vector<SparseDepth>> known = findSparseDepths(capture, frame, kMaxReprojectionError);
  const std::vector<int> photos = capture.photosIn(Split::train);
  struct PhotoTiling {
    std::vector<PhotoTile> tiles;
    std::vector<std::vector<uint32_t>> cells;
  };
  std::vector<PhotoTiling> tilings(photos.size());
  ThreadPool pool;
  pool.run(photos.size(), [&](size_t k, int) {
    const Camera& camera = capture.cameras[capture.photos[photos[k]].camera];
    const TileCounts counts(camera);
    const std::vector<double> depths = coarseDepths(camera, counts, known[photos[k]]);
    for (uint32_t j = 0; j < counts.rows; ++j) {
      for (uint32_t i = 0; i < counts.columns; ++i) {
        tilings[k].tiles.push_back(counts.tile(camera, photos[k], i, j));
        tilings[k].cells.push_back(
            cellsBehind(tilings[k].tiles.back(), capture, frame, space, depths[i + size_t{counts.columns} * j]));
      }
    }
  });
  TiledPhotos all;
  std::map<std::vector<uint32_t>, uint32_t> numberOfSet;
  for (const PhotoTiling& photo : tilings) {
    for (size_t i = 0; i < photo.tiles.size(); ++i) {
      const auto [place, isNew] = numberOfSet.emplace(photo.cells[i], static_cast<uint32_t>(all.sets.size()));
      if (isNew) all.sets.push_back(photo.cells[i]);
      all.tiles.push_back(photo.tiles[i]);
      all.setOfTile.push_back(place->second);
    }
  }
  return all;
}

std::vector<TileShares> computeTileShares(const TiledPhotos& photos, const std::vector<double>& shareOfSet,
                                          size_t photoCount) {
  CHECK(shareOfSet.size() == photos.sets.size());
  std::vector<TileShares> shares(photoCount);
  for (size_t i = 0; i < photos.tiles.size(); ++i) {
    const double share = shareOfSet[photos.setOfTile[i]];
    if (!(share > 0)) continue;
    TileShares& ofPhoto = shares[photos.tiles[i].photo];
    ofPhoto.until.push_back(ofPhoto.total() + share);
    ofPhoto.tiles.push_back(photos.tiles[i]);
  }
  return shares;
}

}  // namespace tessera
