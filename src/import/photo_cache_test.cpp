#include "import/photo_cache.h"

#include <gtest/gtest.h>

#include <atomic>

#include "base/error.h"
#include "import/testing/test_support.h"

namespace tessera {
namespace {

constexpr int kSide = 16;
constexpr int64_t kPhotoBytes = kSide * kSide * 3;

class PhotoCacheTest : public testing::Test {
 protected:
  void make(int photos) {
    capture_.root = folder_.path();
    capture_.cameras = {{kSide, kSide, LensModel::pinhole, {10, 10, 8, 8}}};
    for (int i = 0; i < photos; ++i) {
      Photo photo;
      photo.image = folder_ / ("photo" + std::to_string(i) + ".png");
      writePng(photo.image, gradientPicture(kSide, kSide, 3, i));
      capture_.photos.push_back(photo);
    }
  }
  TemporaryFolder folder_;
  Capture capture_;
};

TEST_F(PhotoCacheTest, ReturnsTheRequestedPhoto) {
  make(3);
  PhotoCache cache(capture_, 100 * kPhotoBytes);
  for (int i : {2, 0, 1, 2}) EXPECT_EQ(cache.get(i)->image.pixels, gradientPicture(kSide, kSide, 3, i).pixels);
  EXPECT_EQ(cache.counts().misses, 3);
  EXPECT_EQ(cache.counts().hits, 1);
  EXPECT_EQ(cache.counts().bytes, 3 * kPhotoBytes);
}

TEST_F(PhotoCacheTest, EvictsTheLeastRecentlyUsedPhotoFirst) {
  make(3);
  PhotoCache cache(capture_, 2 * kPhotoBytes);
  cache.get(0);
  cache.get(1);
  cache.get(0);
  cache.get(2);  // evicts 1
  cache.get(0);
  EXPECT_EQ(cache.counts().misses, 3);
  cache.get(1);
  EXPECT_EQ(cache.counts().misses, 4);
  EXPECT_EQ(cache.counts().peakBytes, 2 * kPhotoBytes);
}

TEST_F(PhotoCacheTest, CountsPhotosInUseAgainstItsBudgetAndEvictsOthers) {
  make(4);
  PhotoCache cache(capture_, 2 * kPhotoBytes);
  const auto photo = cache.get(0);
  for (int i : {1, 2, 3, 1, 2, 3}) cache.get(i);
  EXPECT_EQ(cache.counts().peakBytes, 2 * kPhotoBytes);
  EXPECT_EQ(cache.get(0), photo);
}

TEST_F(PhotoCacheTest, WaitsUntilAPhotoInUseIsReleased) {
  make(2);
  PhotoCache cache(capture_, kPhotoBytes);
  auto photo = cache.get(0);
  std::atomic<bool> came = false;
  std::thread other([&] {
    cache.get(1);
    came = true;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(came);
  photo.reset();
  other.join();
  EXPECT_TRUE(came);
  EXPECT_EQ(cache.counts().peakBytes, kPhotoBytes);
}

TEST_F(PhotoCacheTest, LoadsAPhotoLargerThanItsBudgetAlone) {
  make(2);
  PhotoCache cache(capture_, 10);
  cache.get(0);
  cache.get(1);
  EXPECT_EQ(cache.counts().peakBytes, kPhotoBytes);
}

TEST_F(PhotoCacheTest, PrefetchesInTheBackground) {
  make(2);
  PhotoCache cache(capture_, 2 * kPhotoBytes);
  cache.prefetch(1);
  while (cache.counts().bytes == 0) std::this_thread::yield();
  cache.get(1);
  EXPECT_EQ(cache.counts().misses, 0);
  EXPECT_EQ(cache.counts().hits, 1);
}

TEST_F(PhotoCacheTest, NamesADamagedFileAndContinues) {
  make(2);
  fs::resize_file(capture_.photos[0].image, 60);
  PhotoCache cache(capture_, kPhotoBytes);  // if a failure leaked bytes, nothing else would fit
  for (int attempt = 0; attempt < 2; ++attempt) {
    cache.prefetch(0);
    try {
      cache.get(0);
      FAIL() << "a damaged photo came in";
    } catch (const Error& error) {
      EXPECT_EQ(error.subject(), capture_.photos[0].image.string());
    }
  }
  const auto whole = cache.get(1);  // in use: a late prefetch of the damaged photo cannot reserve memory
  EXPECT_EQ(whole->image.pixels, gradientPicture(kSide, kSide, 3, 1).pixels);
  EXPECT_EQ(cache.counts().bytes, kPhotoBytes);
}

TEST_F(PhotoCacheTest, RefusesAPhotoOfAnotherSizeThanItsCamera) {
  make(1);
  capture_.cameras[0].width = 17;
  PhotoCache cache(capture_, kPhotoBytes);
  EXPECT_THROW(cache.get(0), Error);
}

TEST_F(PhotoCacheTest, LoadsTheMaskToo) {
  make(1);
  ImageU8 mask(kSide, kSide, 1, 255);
  mask.at(3, 5)[0] = 0;
  capture_.photos[0].mask = folder_ / "mask.png";
  writePng(capture_.photos[0].mask, mask);
  PhotoCache cache(capture_, 10 * kPhotoBytes);
  EXPECT_EQ(cache.get(0)->mask.pixels, mask.pixels);
  EXPECT_EQ(cache.counts().bytes, kPhotoBytes + kSide * kSide);
}

TEST_F(PhotoCacheTest, SurvivesManyThreadsWithinItsBudget) {
  make(8);
  std::shared_ptr<const DecodedPhoto> survivor;
  {
    PhotoCache cache(capture_, 4 * kPhotoBytes);
    std::vector<std::thread> threads;
    std::atomic<int> wrong = 0;
    for (int t = 0; t < 3; ++t) {
      threads.emplace_back([&, t] {
        for (int i = 0; i < 100; ++i) {
          const int photo = (i * (t + 2) + t) % 8;
          cache.prefetch((photo + 3) % 8);
          const auto decoded = cache.get(photo);
          wrong += decoded->image.pixels[0] != static_cast<uint8_t>(photo);
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(wrong, 0);
    EXPECT_LE(cache.counts().peakBytes, 4 * kPhotoBytes);
    EXPECT_EQ(cache.counts().hits + cache.counts().misses, 300);
    survivor = cache.get(5);
  }
  EXPECT_EQ(survivor->image.pixels[0], 5);
}

}  // namespace
}  // namespace tessera
