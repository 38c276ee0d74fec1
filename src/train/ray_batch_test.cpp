#include "train/ray_batch.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

namespace tessera {
namespace {

ThreadPool& pool() {
  static ThreadPool pool(2);
  return pool;
}

PhotoWindow::Entry entry(int photo, ImageU8 image, ImageU8 mask = {}) {
  auto decoded = std::make_shared<DecodedPhoto>();
  decoded->image = std::move(image);
  decoded->mask = std::move(mask);
  return {photo, decoded};
}

// An image whose pixels encode their position: red = 16 x, green = 16 y, blue = photo.
ImageU8 addressed(int width, int height, int photo, int channels = 3, uint8_t alpha = 255) {
  ImageU8 image(width, height, channels);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      uint8_t* pixel = image.at(x, y);
      pixel[0] = static_cast<uint8_t>(16 * x);
      pixel[1] = static_cast<uint8_t>(16 * y);
      pixel[2] = static_cast<uint8_t>(photo);
      if (channels == 4) pixel[3] = alpha;
    }
  }
  return image;
}

std::vector<PhotoWindow::Entry> twoPhotos() {
  return {entry(4, addressed(7, 5, 4)), entry(9, addressed(5, 9, 9))};
}

RayBatch draw(const std::vector<PhotoWindow::Entry>& window, uint64_t seed, int64_t step, uint32_t rays = 2000) {
  RayBatch batch;
  drawRays(window, {}, {seed, true, 0, nullptr}, step, rays, pool(), batch);
  return batch;
}

TEST(RayBatch, IsAFunctionOfSeedAndStep) {
  const RayBatch first = draw(twoPhotos(), 1, 7), again = draw(twoPhotos(), 1, 7);
  EXPECT_EQ(first.pixels, again.pixels);
  EXPECT_EQ(first.photoOfRay, again.photoOfRay);
  EXPECT_EQ(first.jitter, again.jitter);
  EXPECT_EQ(first.backgrounds, again.backgrounds);
  EXPECT_NE(first.pixels, draw(twoPhotos(), 1, 8).pixels);
  EXPECT_NE(first.pixels, draw(twoPhotos(), 2, 7).pixels);
}

TEST(RayBatch, BeginsWithTheSameRaysWhateverTheirNumber) {
  const RayBatch many = draw(twoPhotos(), 1, 7), few = draw(twoPhotos(), 1, 7, 50);
  ASSERT_EQ(few.pixels.size(), 100u);
  EXPECT_TRUE(std::equal(few.pixels.begin(), few.pixels.end(), many.pixels.begin()));
  EXPECT_TRUE(std::equal(few.targets.begin(), few.targets.end(), many.targets.begin()));
}

TEST(RayBatch, DrawsSquaresOfNeighbouringPixelsAroundThoseOfTiles) {
  std::vector<TileShares> tiles(10);
  tiles[4] = {{{4, 2, 1, 6, 5}}, {16}};
  constexpr uint32_t kSquares = 4000;
  RayBatch batch;
  drawRays(twoPhotos(), {}, {1, true, 0, &tiles, 3}, 7, 9 * kSquares, pool(), batch);
  std::set<std::pair<float, float>> corners, pixels;
  for (size_t square = 0; square < kSquares; ++square) {
    const float left = batch.pixels[18 * square], top = batch.pixels[18 * square + 1];
    corners.insert({left, top});
    for (size_t i = 0; i < 9; ++i) {
      EXPECT_EQ(batch.photoOfRay[9 * square + i], 4u);
      const float x = batch.pixels[2 * (9 * square + i)], y = batch.pixels[2 * (9 * square + i) + 1];
      EXPECT_EQ(x, left + static_cast<float>(i % 3));
      EXPECT_EQ(y, top + static_cast<float>(i / 3));
      pixels.insert({x, y});
    }
  }
  EXPECT_EQ(corners.size(), 15u) << "all squares of the image that contain a pixel of the tile";
  EXPECT_EQ(pixels.size(), 35u);
  EXPECT_NE(batch.backgrounds[0], batch.backgrounds[3]) << "of rays of one square";
}

TEST(RayBatch, DrawsFromTilesByTheirShares) {
  std::vector<TileShares> tiles(10);
  tiles[4] = {{{4, 0, 0, 2, 5}, {4, 5, 1, 7, 2}}, {1, 4}};
  tiles[9] = {{{9, 3, 3, 4, 4}}, {4}};
  RayBatchOptions options{1, true, 0.5, &tiles};
  RayBatch batch;
  constexpr uint32_t kMany = 8000;
  drawRays(twoPhotos(), {}, options, 3, kMany, pool(), batch);
  int counts[3] = {};
  for (uint32_t ray = 0; ray < kMany; ++ray) {
    const float x = batch.pixels[2 * ray], y = batch.pixels[2 * ray + 1];
    EXPECT_EQ(batch.weights[ray], 1);
    if (batch.photoOfRay[ray] == 9) {
      EXPECT_TRUE(x == 3.5f && y == 3.5f);
      ++counts[2];
    } else if (x < 2) {
      ++counts[0];
    } else {
      EXPECT_TRUE(x > 5 && y > 1 && y < 2);
      ++counts[1];
    }
  }
  EXPECT_NEAR(counts[0], kMany / 8, 150);
  EXPECT_NEAR(counts[1], 3 * kMany / 8, 200);
  EXPECT_NEAR(counts[2], kMany / 2, 200);
}

TEST(RayBatch, GivesRaysNoWeightWhereThePhotosHaveNoTile) {
  const std::vector<TileShares> tiles(10);
  RayBatch batch;
  drawRays(twoPhotos(), {}, {1, true, 0, &tiles}, 3, 50, pool(), batch);
  for (const float weight : batch.weights) EXPECT_EQ(weight, 0);
}

TEST(RayBatch, TakesColoursFromThePixelsItNames) {
  const RayBatch batch = draw(twoPhotos(), 3, 0);
  std::set<std::array<float, 3>> seen;
  for (size_t ray = 0; ray < batch.weights.size(); ++ray) {
    const float x = batch.pixels[2 * ray], y = batch.pixels[2 * ray + 1];
    EXPECT_FLOAT_EQ(batch.targets[3 * ray], 16 * (x - 0.5f) / 255);
    EXPECT_FLOAT_EQ(batch.targets[3 * ray + 1], 16 * (y - 0.5f) / 255);
    EXPECT_FLOAT_EQ(batch.targets[3 * ray + 2], static_cast<float>(batch.photoOfRay[ray]) / 255);
    EXPECT_EQ(batch.weights[ray], 1);
    EXPECT_GE(batch.jitter[ray], 0);
    EXPECT_LT(batch.jitter[ray], 1);
    seen.insert({static_cast<float>(batch.photoOfRay[ray]), x, y});
  }
  EXPECT_EQ(seen.size(), 7u * 5 + 5 * 9);  // every pixel is drawn
}

TEST(RayBatch, GivesMaskedPixelsNoWeightAndPrefersOthers) {
  ImageU8 mask(7, 5, 1, 255);
  for (int y = 0; y < 5; ++y) *mask.at(3, y) = 0;
  const RayBatch batch = draw({entry(0, addressed(7, 5, 0), mask)}, 1, 0);
  int masked = 0;
  for (size_t ray = 0; ray < batch.weights.size(); ++ray) {
    const bool inMask = batch.pixels[2 * ray] == 3.5f;
    EXPECT_EQ(batch.weights[ray], inMask ? 0 : 1);
    masked += inMask;
  }
  EXPECT_LT(masked, 2000 / 7 / 4);  // a seventh of the pixels, drawn again
}

TEST(RayBatch, GivesRaysOfFullyMaskedPhotosNoWeight) {
  const RayBatch batch = draw({entry(0, addressed(7, 5, 0), ImageU8(7, 5, 1, 0))}, 1, 0, 100);
  EXPECT_EQ(batch.weights, std::vector<float>(100, 0.0f));
  for (const float pixel : batch.pixels) EXPECT_GT(pixel, 0);  // they are valid rays nevertheless
}

TEST(RayBatch, LaysTransparentPixelsOverTheBackground) {
  for (const int alpha : {0, 51, 255}) {
    const RayBatch batch = draw({entry(0, addressed(7, 5, 100, 4, static_cast<uint8_t>(alpha)))}, 1, 0, 200);
    const float opacity = static_cast<float>(alpha) / 255;
    EXPECT_EQ(batch.weights, std::vector<float>(200, 1));
    EXPECT_EQ(batch.opaqueWeights, std::vector<float>(200, alpha == 255 ? 1.0f : 0.0f));
    std::set<float> backgrounds;
    for (size_t ray = 0; ray < batch.weights.size(); ++ray) {
      const float behind = batch.backgrounds[3 * ray + 2];
      EXPECT_NEAR(batch.targets[3 * ray + 2], opacity * 100 / 255 + (1 - opacity) * behind, 1e-6);
      backgrounds.insert(behind);
    }
    EXPECT_GT(backgrounds.size(), 150u);  // they are random
  }
}

TEST(RayBatch, UsesBlackBackgroundsUnlessTheyAreRandom) {
  RayBatch batch;
  drawRays({entry(0, addressed(7, 5, 100, 4, 51))}, {}, {1, false, 0}, 0, 100, pool(), batch);
  EXPECT_EQ(batch.backgrounds, std::vector<float>(300, 0.0f));
  EXPECT_NEAR(batch.targets[2], 0.2f * 100 / 255, 1e-6);
}

TEST(RayBatch, ReadsGreyPhotosAsGrey) {
  const RayBatch batch = draw({entry(0, ImageU8(4, 4, 1, 51))}, 1, 0, 100);
  for (const float target : batch.targets) EXPECT_FLOAT_EQ(target, 0.2f);
}

TEST(RayBatch, DrawsAShareOfItsRaysThroughSparsePoints) {
  std::vector<std::vector<SparseDepth>> known(10);
  known[4] = {{1, 2, 1.5f}, {6, 4, 2.5f}, {7, 0, 9.0f}};  // the last one lies outside the photo
  RayBatch batch;
  drawRays(twoPhotos(), known, {1, true, 0.25}, 0, 4000, pool(), batch);
  int inFour = 0, counts[2] = {};
  for (size_t ray = 0; ray < batch.weights.size(); ++ray) {
    const float x = batch.pixels[2 * ray], y = batch.pixels[2 * ray + 1];
    EXPECT_FLOAT_EQ(batch.targets[3 * ray], 16 * (x - 0.5f) / 255);
    inFour += batch.photoOfRay[ray] == 4;
    if (batch.distances[ray] == 0) continue;
    EXPECT_EQ(batch.photoOfRay[ray], 4u);
    const bool first = batch.distances[ray] == 1.5f;
    EXPECT_TRUE(first ? x == 1.5f && y == 2.5f : batch.distances[ray] == 2.5f && x == 6.5f && y == 4.5f);
    ++counts[first];
  }
  EXPECT_NEAR(inFour, 2000, 150);
  EXPECT_NEAR(counts[0], 2000 * 0.25 / 3, 50);
  EXPECT_NEAR(counts[1], 2000 * 0.25 / 3, 50);
  drawRays(twoPhotos(), known, {1, true, 0}, 0, 4000, pool(), batch);
  EXPECT_EQ(batch.distances, std::vector<float>(4000, 0.0f));
}

TEST(RayBatch, DrawsSparsePointsOnlyInsideTiles) {
  std::vector<std::vector<SparseDepth>> known(10);
  known[4] = {{1, 2, 1.5f}, {6, 1, 2.5f}, {3, 3, 3.5f}};  // the last one is in no tile
  known[9] = {{0, 0, 9.0f}};
  std::vector<TileShares> tiles(10);
  tiles[4] = {{{4, 0, 0, 2, 5}, {4, 5, 0, 7, 5}}, {1, 4}};
  tiles[9] = {{{9, 3, 3, 4, 4}}, {4}};
  RayBatch batch;
  drawRays(twoPhotos(), known, {1, true, 0.5, &tiles}, 0, 4000, pool(), batch);
  std::map<float, int> drawn;
  for (size_t ray = 0; ray < batch.weights.size(); ++ray) {
    ++drawn[batch.distances[ray]];
    if (batch.distances[ray] == 0) continue;
    EXPECT_EQ(batch.photoOfRay[ray], 4u);
    EXPECT_EQ(batch.pixels[2 * ray], batch.distances[ray] == 1.5f ? 1.5f : 6.5f);
  }
  EXPECT_EQ(drawn.size(), 3u);
  EXPECT_NEAR(drawn[1.5f], drawn[2.5f], 80);
  EXPECT_GT(drawn[1.5f], 300);  // of about 1000 attempts to use a sparse depth of this photo
}

TEST(RayBatch, IgnoresSparseDepthsUnderMasks) {
  const std::vector<std::vector<SparseDepth>> known = {{{3, 2, 1.5f}}};
  RayBatch batch;
  drawRays({entry(0, addressed(7, 5, 0), ImageU8(7, 5, 1, 0))}, known, {1, true, 1}, 0, 100, pool(), batch);
  EXPECT_EQ(batch.distances, std::vector<float>(100, 0.0f));
}

TEST(RayBatch, ShrinksWithTheNumberOfRays) {
  RayBatch batch;
  drawRays(twoPhotos(), {}, {1, true, 0}, 0, 100, pool(), batch);
  drawRays(twoPhotos(), {}, {1, true, 0}, 1, 10, pool(), batch);
  EXPECT_EQ(batch.weights.size(), 10u);
  EXPECT_EQ(batch.targets.size(), 30u);
  EXPECT_EQ(batch.photoOfRay.size(), 10u);
}

TEST(RayBatch, DoesNotDependOnTheNumberOfThreads) {
  constexpr uint32_t kRays = 5000;
  ImageU8 mask(7, 5, 1, 255);
  for (int x = 0; x < 4; ++x) *mask.at(x, 2) = 0;
  const std::vector<PhotoWindow::Entry> window = {entry(0, addressed(7, 5, 0, 4, 128), std::move(mask)),
                                                  entry(1, addressed(5, 9, 1))};
  const std::vector<std::vector<SparseDepth>> known = {{{3, 1, 2.0f}}, {{2, 7, 5.0f}, {4, 8, 3.0f}}};
  const std::vector<TileShares> tiles = {{{{0, 0, 0, 7, 5}}, {1}}, {{{1, 0, 0, 5, 4}, {1, 0, 4, 5, 9}}, {1, 3}}};
  for (const std::vector<TileShares>* drawnFrom : {static_cast<const std::vector<TileShares>*>(nullptr), &tiles}) {
    std::vector<RayBatch> batches(3);
    for (int threads = 1; threads <= 3; ++threads) {
      ThreadPool others(threads);
      drawRays(window, known, {1, true, 0.5, drawnFrom}, 7, kRays, others, batches[threads - 1]);
    }
    for (const RayBatch& batch : {batches[1], batches[2]}) {
      EXPECT_EQ(batch.photoOfRay, batches[0].photoOfRay);
      EXPECT_EQ(batch.pixels, batches[0].pixels);
      EXPECT_EQ(batch.targets, batches[0].targets);
      EXPECT_EQ(batch.backgrounds, batches[0].backgrounds);
      EXPECT_EQ(batch.weights, batches[0].weights);
      EXPECT_EQ(batch.jitter, batches[0].jitter);
      EXPECT_EQ(batch.distances, batches[0].distances);
    }
  }
}

}  // namespace
}  // namespace tessera
