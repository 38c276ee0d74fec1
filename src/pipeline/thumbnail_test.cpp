#include "pipeline/thumbnail.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/image_io.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

// Rows of letters, one for each pixel.
ImageU8 letters(const std::vector<std::string>& rows) {
  ImageU8 image(static_cast<int>(rows[0].size()), static_cast<int>(rows.size()), 1);
  for (size_t y = 0; y < rows.size(); ++y) std::copy(rows[y].begin(), rows[y].end(), image.at(0, static_cast<int>(y)));
  return image;
}

std::vector<std::string> rows(const ImageU8& image) {
  std::vector<std::string> rows;
  for (int y = 0; y < image.height; ++y) rows.emplace_back(image.at(0, y), image.at(0, y) + image.width);
  return rows;
}

TEST(Thumbnail, IsTurnedByEachOrientationOfExif) {
  // What a viewer must show, of which cameras store the following.
  const std::vector<std::string> upright = {"abc", "def"};
  const std::vector<std::pair<int, std::vector<std::string>>> stored = {
      {1, {"abc", "def"}},     {2, {"cba", "fed"}},     {3, {"fed", "cba"}},     {4, {"def", "abc"}},
      {5, {"ad", "be", "cf"}}, {6, {"cf", "be", "ad"}}, {7, {"fc", "eb", "da"}}, {8, {"da", "eb", "fc"}}};
  for (const auto& [orientation, picture] : stored)
    EXPECT_EQ(rows(turnUpright(letters(picture), orientation)), upright) << orientation;
  for (const int unknown : {0, 9, -1}) EXPECT_EQ(rows(turnUpright(letters(upright), unknown)), upright) << unknown;
}

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
