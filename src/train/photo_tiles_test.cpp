#include "train/photo_tiles.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "base/random.h"

namespace tessera {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

BlockSpace space(uint32_t columns, uint32_t rows, BackgroundBlockMode backgroundBlock = BackgroundBlockMode::own) {
  BlockSpace blockSpace;
  blockSpace.columns = columns;
  blockSpace.rows = rows;
  blockSpace.bottom = -0.5f;
  blockSpace.top = 0.5f;
  blockSpace.backgroundBlock = backgroundBlock;
  return blockSpace;
}

// A photo of 64 × 48 pixels that looks straight down from `place`; its x axis is the scene's x axis, its y axis is -y.
Capture fromAbove(const Vec3d& place) {
  Capture capture;
  Camera camera;
  camera.width = 64;
  camera.height = 48;
  camera.parameters = {32, 32, 32, 24};
  capture.cameras.push_back(camera);
  capture.photos.resize(1);
  capture.photos[0].worldFromCamera.rotation = Vec3d(1, -1, -1).asDiagonal();
  capture.photos[0].worldFromCamera.translation = place;
  return capture;
}

std::vector<uint32_t> setAt(const TiledPhotos& photos, uint32_t x, uint32_t y) {
  for (size_t i = 0; i < photos.tiles.size(); ++i) {
    const PhotoTile& tile = photos.tiles[i];
    if (x >= tile.left && x < tile.right && y >= tile.top && y < tile.bottom) return photos.sets[photos.setOfTile[i]];
  }
  return {99};
}

TEST(PhotoTiles, FindTheCellsThatThePointsOfARayLieIn) {
  const RandomStream random(3, 1);
  for (const BackgroundBlockMode backgroundBlock :
       {BackgroundBlockMode::own, BackgroundBlockMode::border, BackgroundBlockMode::none}) {
    const BlockSpace blocks = space(4, 3, backgroundBlock);
    int met = 0;
    for (uint64_t i = 0; i < 300; ++i) {
      Vec3d origin, direction;
      for (int a = 0; a < 3; ++a) {
        origin[a] = 8 * random.uniform(8 * i + a) - 4;
        direction[a] = 2 * random.uniform(8 * i + 3 + a) - 1;
      }
      origin.z() = 2;
      direction.z() = -std::abs(direction.z()) / 4;
      if (i % 5 == 0) direction.y() = 0;
      direction.normalize();
      const double farthest = i % 3 == 0 ? 7 : kInfinity;
      std::vector<uint32_t> brute;
      for (double t = 0.0005; t < std::min(40.0, farthest); t += 0.001) {
        const Vec3d x = origin + t * direction;
        if (std::abs(x.x()) > 4 || std::abs(x.y()) > 3 || std::abs(x.z()) > 0.5) continue;
        const uint32_t cell = blocks.blockAt(x.x(), x.y(), x.z());
        if (brute.empty() || brute.back() != cell) brute.push_back(cell);
      }
      const std::vector<uint32_t> cells = cellsAlong(blocks, origin, direction, farthest);
      // Rays may cut corners over less than a brute-force step.
      EXPECT_TRUE(std::includes(cells.begin(), cells.end(), brute.begin(), brute.end()) || cells == brute ||
                  std::set<uint32_t>(cells.begin(), cells.end()).size() >= brute.size())
          << i;
      if (cells == brute) ++met;
    }
    EXPECT_GE(met, 295);
  }
}

TEST(PhotoTiles, CoverEveryPixelExactlyOnce) {
  for (const auto& [width, height] : {std::pair{64, 48}, std::pair{33, 100}, std::pair{7, 5}, std::pair{1000, 10}}) {
    Capture capture = fromAbove({0, 0, 3});
    capture.cameras[0].width = width;
    capture.cameras[0].height = height;
    const TiledPhotos photos = tilePhotos(capture, SceneFrame(), space(2, 2));
    std::vector<int> covered(static_cast<size_t>(width) * height);
    for (const PhotoTile& tile : photos.tiles) {
      ASSERT_LE(tile.right, static_cast<uint32_t>(width));
      ASSERT_LE(tile.bottom, static_cast<uint32_t>(height));
      for (uint32_t y = tile.top; y < tile.bottom; ++y) {
        for (uint32_t x = tile.left; x < tile.right; ++x) ++covered[x + static_cast<size_t>(width) * y];
      }
    }
    EXPECT_TRUE(std::all_of(covered.begin(), covered.end(), [](int times) { return times == 1; }));
    EXPECT_LE(photos.tiles.size(), size_t{kTilesAcross} * kTilesAcross);
  }
}

TEST(PhotoTiles, FindTheBlocksThatAreVisibleThroughThem) {
  const TiledPhotos photos = tilePhotos(fromAbove({0, 0, 2.5}), SceneFrame(), space(2, 2));
  EXPECT_EQ(setAt(photos, 10, 40), (std::vector<uint32_t>{0}));  // bottom left: x < 0, y < 0
  EXPECT_EQ(setAt(photos, 50, 40), (std::vector<uint32_t>{1}));
  EXPECT_EQ(setAt(photos, 10, 5), (std::vector<uint32_t>{2}));
  EXPECT_EQ(setAt(photos, 50, 5), (std::vector<uint32_t>{3}));
  // From the side, oblique rays pass from one block into another.
  const TiledPhotos oblique = tilePhotos(fromAbove({-1.5, -1, 2.5}), SceneFrame(), space(2, 2));
  EXPECT_EQ(setAt(oblique, 50, 24), (std::vector<uint32_t>{0, 1}));
  // From far away, they miss all blocks.
  EXPECT_EQ(setAt(tilePhotos(fromAbove({-90, 0, 2.5}), SceneFrame(), space(2, 2)), 10, 24), std::vector<uint32_t>());
}

TEST(PhotoTiles, EndAtTheCoarseDepthWherePointsAreKnown) {
  Capture capture = fromAbove({-1.5, -1, 2.5});
  ASSERT_EQ(setAt(tilePhotos(capture, SceneFrame(), space(2, 2)), 50, 24), (std::vector<uint32_t>{0, 1}));
  // The point lies just below the top of the box, before the ray enters the other block.
  const Camera& camera = capture.cameras[0];
  const Vec3d ray = capture.photos[0].worldFromCamera.rotation * *camera.directionInCamera({50.5, 24.5});
  const Vec3d point = capture.photos[0].worldFromCamera.translation + 2.02 / -ray.z() * ray;
  for (size_t k = 0; k < kEnoughKnown; ++k) {
    EXPECT_EQ(setAt(tilePhotos(capture, SceneFrame(), space(2, 2)), 50, 24), (std::vector<uint32_t>{0, 1}));
    capture.observations.push_back({0, static_cast<uint32_t>(capture.points.size()), 50.5f, 24.5f, 0.1f});
    capture.points.push_back({point, {}, 0.1f});
  }
  const double slack = kDepthSlack * 2.02 / -ray.z();
  const std::vector<uint32_t> expected =
      cellsAlong(space(2, 2), capture.photos[0].worldFromCamera.translation, ray, slack);
  EXPECT_EQ(setAt(tilePhotos(capture, SceneFrame(), space(2, 2)), 50, 24), expected);
  EXPECT_EQ(expected, (std::vector<uint32_t>{0}));
}

TEST(PhotoTiles, TakeTheSharesOfTheirSets) {
  const TiledPhotos photos = tilePhotos(fromAbove({0, 0, 2.5}), SceneFrame(), space(2, 2));
  std::vector<double> shares(photos.sets.size());
  const auto first = std::find(photos.sets.begin(), photos.sets.end(), std::vector<uint32_t>{0});
  ASSERT_NE(first, photos.sets.end());
  shares[static_cast<size_t>(first - photos.sets.begin())] = 0.5;
  const std::vector<TileShares> tileShares = computeTileShares(photos, shares, 3);
  ASSERT_EQ(tileShares.size(), 3u);
  ASSERT_FALSE(tileShares[0].tiles.empty());
  EXPECT_DOUBLE_EQ(tileShares[0].total(), 0.5 * static_cast<double>(tileShares[0].tiles.size()));
  for (const PhotoTile& tile : tileShares[0].tiles)
    EXPECT_EQ(setAt(photos, tile.left, tile.top), std::vector<uint32_t>{0});
  EXPECT_EQ(tileShares[1].total(), 0);
}

}  // namespace
}  // namespace tessera
