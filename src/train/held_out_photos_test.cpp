#include "train/held_out_photos.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace tessera {
namespace {

Capture photographs(int count) {
  Capture capture;
  Camera camera;
  camera.width = 48;
  camera.height = 27;
  capture.cameras.push_back(camera);
  capture.photos.resize(static_cast<size_t>(count));
  return capture;
}

std::vector<size_t> listSharedPhotos(const std::vector<TileShares>& shares) {
  std::vector<size_t> photos;
  for (size_t photo = 0; photo < shares.size(); ++photo) {
    if (shares[photo].total() == 0) continue;
    photos.push_back(photo);
    EXPECT_EQ(shares[photo].total(), 48 * 27);
    EXPECT_EQ(shares[photo].tiles.size(), 1u);
    EXPECT_EQ(shares[photo].tiles[0].photo, static_cast<int>(photo));
    EXPECT_EQ(shares[photo].tiles[0].right, 48u);
    EXPECT_EQ(shares[photo].tiles[0].bottom, 27u);
  }
  return photos;
}

TEST(HeldOutPhotos, AreOneInTenTrainingPhotosAndNoTestPhotos) {
  Capture capture = photographs(23);
  capture.photos[2].split = Split::test;
  const HeldOutPhotos photos = holdOutPhotos(capture, 10, 3);
  EXPECT_EQ(listSharedPhotos(photos.heldOut), (std::vector<size_t>{4, 14}));
  const std::vector<size_t> trained = listSharedPhotos(photos.trained);
  EXPECT_EQ(trained.size(), 20u);
  for (const size_t none : {2, 4, 14}) EXPECT_EQ(std::count(trained.begin(), trained.end(), none), 0) << none;
}

TEST(HeldOutPhotos, AreOneOfFewTrainingPhotosAndNeverAll) {
  for (const int count : {2, 3, 9}) {
    for (uint64_t seed = 0; seed < 12; ++seed) {
      const HeldOutPhotos photos = holdOutPhotos(photographs(count), 10, seed);
      EXPECT_EQ(listSharedPhotos(photos.heldOut).size(), 1u);
      EXPECT_EQ(listSharedPhotos(photos.trained).size(), static_cast<size_t>(count) - 1);
    }
  }
}

}  // namespace
}  // namespace tessera
