#include "train/photo_window.h"

#include <gtest/gtest.h>

#include <map>
#include <numeric>
#include <set>

#include "train/testing/test_support.h"

namespace tessera {
namespace {

std::vector<int> allPhotoIndices(const Capture& capture) {
  std::vector<int> photos(capture.photos.size());
  std::iota(photos.begin(), photos.end(), 0);
  return photos;
}

std::vector<int> photosIn(const std::vector<PhotoWindow::Entry>& entries) {
  std::vector<int> photos;
  for (const PhotoWindow::Entry& entry : entries) photos.push_back(entry.photo);
  return photos;
}

// A budget for a window of `photos`, and one more that is being decoded.
PhotoWindow::Settings budgetFor(size_t photos, uint64_t seed = 3) {
  return {kPlainPhotoBytes * (photos + 1), 2, seed};
}

TEST(PhotoWindow, HoldsAllPhotosWhenThereIsNoBudgetOrAllFit) {
  const TemporaryFolder folder;
  const Capture capture = plainCapture(folder.path(), 6);
  for (const size_t budget : {size_t{0}, 6 * kPlainPhotoBytes}) {
    PhotoWindow window(capture, {1, 3, 5}, {budget, 2, 0});
    EXPECT_TRUE(window.holdsAll());
    for (const int64_t step : {0, 1, 100}) EXPECT_EQ(photosIn(window.at(step)), (std::vector<int>{1, 3, 5}));
    EXPECT_EQ(window.counts().misses, 3);  // decoded once
  }
}

TEST(PhotoWindow, HandsOutEachPhotoWithItsOwnPixels) {
  const TemporaryFolder folder;
  const Capture capture = plainCapture(folder.path(), 9);
  PhotoWindow window(capture, allPhotoIndices(capture), budgetFor(3));
  EXPECT_FALSE(window.holdsAll());
  for (int64_t step = 0; step < 60; ++step) {
    for (const PhotoWindow::Entry& entry : window.at(step)) {
      ASSERT_TRUE(entry.decoded);
      ASSERT_EQ(entry.decoded->image.pixels[0], 8 * entry.photo) << step;
    }
  }
}

TEST(PhotoWindow, NeverExceedsTheBudget) {
  const TemporaryFolder folder;
  const Capture capture = plainCapture(folder.path(), 9);
  for (const size_t places : {size_t{1}, size_t{2}, size_t{5}}) {
    PhotoWindow window(capture, allPhotoIndices(capture), budgetFor(places));
    EXPECT_EQ(window.size(), static_cast<int>(places));
    for (int64_t step = 0; step < 50; ++step) window.at(step);
    window.at(1000);  // a jump, as after resuming
    EXPECT_LE(window.counts().peakBytes, static_cast<int64_t>(kPlainPhotoBytes * (places + 1)));
  }
}

TEST(PhotoWindow, CountsAlphaAndMasksAgainstTheBudget) {
  const TemporaryFolder folder;
  Capture capture = plainCapture(folder.path(), 8);
  for (Photo& photo : capture.photos) {
    writePng(photo.image, ImageU8(16, 12, 4, 200));
    photo.mask = folder / "mask.png";
  }
  writePng(folder / "mask.png", ImageU8(16, 12, 1, 255));
  for (const size_t budget : {16 * 12 * 20, 16 * 12 * 5 * 7}) {  // enough for 4 and for 7 of the 8 photos
    PhotoWindow window(capture, allPhotoIndices(capture), {budget, 1, 0});
    EXPECT_FALSE(window.holdsAll());
    for (int64_t step = 0; step < 20; ++step) EXPECT_EQ(window.at(step)[0].decoded->image.channels, 4);
    EXPECT_LE(window.counts().peakBytes, static_cast<int64_t>(budget));
  }
}

TEST(PhotoWindow, WorksWithOnePhotoWhenNotEvenOneFits) {
  const TemporaryFolder folder;
  const Capture capture = plainCapture(folder.path(), 4);
  PhotoWindow window(capture, allPhotoIndices(capture), {kPlainPhotoBytes / 2, 2, 0});
  std::set<int> seen;
  for (int64_t step = 0; step < 16; ++step) {
    ASSERT_EQ(window.at(step).size(), 1u);
    seen.insert(window.at(step)[0].photo);
  }
  EXPECT_EQ(seen.size(), 4u);
}

TEST(PhotoWindow, UsesEveryPhotoEquallyOften) {
  const TemporaryFolder folder;
  const Capture capture = plainCapture(folder.path(), 10);
  PhotoWindow window(capture, {0, 1, 2, 3, 5, 6, 7, 8}, budgetFor(3));
  std::map<int, int> steps;
  constexpr int kSteps = 8 * 2 * 20;  // twenty shuffles
  for (int64_t step = 0; step < kSteps; ++step) {
    for (const PhotoWindow::Entry& entry : window.at(step)) ++steps[entry.photo];
  }
  ASSERT_EQ(steps.size(), 8u);
  for (const auto& [photo, count] : steps) EXPECT_NEAR(count, kSteps * 3 / 8, kSteps * 3 / 8 / 10) << photo;
}

TEST(PhotoWindow, IsAFunctionOfSeedAndStep) {
  const TemporaryFolder folder;
  const Capture capture = plainCapture(folder.path(), 7);
  PhotoWindow walking(capture, allPhotoIndices(capture), budgetFor(3)),
      other(capture, allPhotoIndices(capture), budgetFor(3, 4));
  std::vector<std::vector<int>> walked;
  bool differs = false;
  for (int64_t step = 0; step < 64; ++step) {
    walked.push_back(photosIn(walking.at(step)));
    differs |= photosIn(other.at(step)) != walked.back();
  }
  EXPECT_TRUE(differs);
  PhotoWindow jumping(capture, allPhotoIndices(capture), budgetFor(3));
  for (const int64_t step : {63, 2, 40, 41, 42, 5, 0}) {
    EXPECT_EQ(photosIn(jumping.at(step)), walked[static_cast<size_t>(step)]) << step;
  }
}

TEST(PhotoWindow, ExchangesOnePhotoAtATime) {
  const TemporaryFolder folder;
  const Capture capture = plainCapture(folder.path(), 7);
  PhotoWindow window(capture, allPhotoIndices(capture), budgetFor(3));
  std::vector<int> last = photosIn(window.at(0));
  for (int64_t step = 1; step < 40; ++step) {
    const std::vector<int> now = photosIn(window.at(step));
    int changed = 0;
    for (size_t i = 0; i < now.size(); ++i) changed += now[i] != last[i];
    EXPECT_LE(changed, step % 2 == 0 ? 1 : 0) << step;
    last = now;
  }
}

}  // namespace
}  // namespace tessera
