#include "pipeline/thumbnail.h"

#include <gtest/gtest.h>

#include "base/image_io.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(Thumbnail, HasItsLongestSideAndIsUpright) {
  const TemporaryFolder folder;
  ImageU8 photo(600, 200, 4, 255);
  for (int x = 300; x < 600; ++x)
    for (int y = 0; y < 200; ++y) photo.at(x, y)[0] = photo.at(x, y)[1] = photo.at(x, y)[2] = 0;
  writePng(folder / "a.png", photo);
  const auto thumbnail = makeThumbnail(folder / "a.png", 6, 240);
  ASSERT_TRUE(thumbnail.has_value());
  EXPECT_EQ(thumbnail->width, 80);
  EXPECT_EQ(thumbnail->height, 240);
  const auto decoded = decodeImage(thumbnail->jpeg);
  ASSERT_TRUE(decoded.has_value());
  EXPECT_EQ(decoded->image.height, 240);
  EXPECT_GT(decoded->image.at(40, 60)[0], 200) << "the left half of what is stored is above";
  EXPECT_LT(decoded->image.at(40, 180)[0], 50);
}

TEST(Thumbnail, IsNotEnlargedAndNothingOfDamagedFiles) {
  const TemporaryFolder folder;
  writeJpeg(folder / "small.jpg", ImageU8(20, 10, 3));
  const auto small = makeThumbnail(folder / "small.jpg", 1, 240);
  ASSERT_TRUE(small.has_value());
  EXPECT_EQ(small->width, 20);
  EXPECT_EQ(small->height, 10);
  writeFileAtomically(folder / "damaged.jpg", "text");
  EXPECT_FALSE(makeThumbnail(folder / "damaged.jpg", 1, 240).has_value());
  EXPECT_FALSE(makeThumbnail(folder / "missing.jpg", 1, 240).has_value());
}

}  // namespace
}  // namespace tessera
