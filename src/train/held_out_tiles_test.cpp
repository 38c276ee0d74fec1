#include "train/held_out_tiles.h"

#include <gtest/gtest.h>

#include <set>

namespace tessera {
namespace {

Capture photographs(int count, int width, int height) {
  Capture capture;
  Camera camera;
  camera.width = width;
  camera.height = height;
  capture.cameras.push_back(camera);
  capture.photos.resize(static_cast<size_t>(count));
  return capture;
}

double pixels(const PhotoTile& tile) {
  return static_cast<double>(tile.right - tile.left) * (tile.bottom - tile.top);
}

TEST(HeldOutTiles, AreATenthOfEachTrainingPhotoAndNotTrainedOn) {
  Capture capture = photographs(4, 480, 270);
  capture.photos[2].split = Split::test;
  const HeldOutTiles tiles = holdOutTiles(capture, 0.1, 7);
  for (size_t photo = 0; photo < 4; ++photo) {
    const TileShares &trained = tiles.trained[photo], &heldOut = tiles.heldOut[photo];
    if (photo == 2) {
      EXPECT_EQ(trained.total() + heldOut.total(), 0) << "of no photo that is for evaluation";
      continue;
    }
    EXPECT_EQ(trained.total() + heldOut.total(), 480 * 270);
    EXPECT_NEAR(heldOut.total(), 0.1 * 480 * 270, 0.01 * 480 * 270);
    std::set<std::pair<uint32_t, uint32_t>> corners;
    for (const TileShares* shares : {&trained, &heldOut}) {
      double sum = 0;
      for (size_t i = 0; i < shares->tiles.size(); ++i) {
        const PhotoTile& tile = shares->tiles[i];
        EXPECT_EQ(tile.photo, static_cast<int>(photo));
        EXPECT_TRUE(corners.emplace(tile.left, tile.top).second) << "in both";
        sum += pixels(tile);
        EXPECT_EQ(shares->until[i], sum) << "pixels weigh the same";
      }
    }
  }
}

TEST(HeldOutTiles, AreOthersInEachPhotoAndWithEachSeed) {
  const Capture capture = photographs(2, 320, 320);
  const auto corners = [](const TileShares& shares) {
    std::vector<std::pair<uint32_t, uint32_t>> all;
    for (const PhotoTile& tile : shares.tiles) all.emplace_back(tile.left, tile.top);
    return all;
  };
  const HeldOutTiles one = holdOutTiles(capture, 0.1, 1), again = holdOutTiles(capture, 0.1, 1),
                     other = holdOutTiles(capture, 0.1, 2);
  EXPECT_EQ(corners(one.heldOut[0]), corners(again.heldOut[0]));
  EXPECT_NE(corners(one.heldOut[0]), corners(one.heldOut[1]));
  EXPECT_NE(corners(one.heldOut[0]), corners(other.heldOut[0]));
}

TEST(HeldOutTiles, LeaveSomethingOfTheSmallestPhotos) {
  const HeldOutTiles two = holdOutTiles(photographs(1, 2, 1), 0.1, 0), one = holdOutTiles(photographs(1, 1, 1), 0.1, 0);
  EXPECT_EQ(two.heldOut[0].total(), 1);
  EXPECT_EQ(two.trained[0].total(), 1);
  EXPECT_EQ(one.heldOut[0].total(), 0);
  EXPECT_EQ(one.trained[0].total(), 1);
}

}  // namespace
}  // namespace tessera
