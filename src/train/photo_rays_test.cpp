#include "train/photo_rays.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "train/photo_loss.h"
#include "train/testing/cube_scene.h"

namespace tessera {
namespace {

constexpr uint32_t kRays = 2000;

CubeScene::Options withPoints() {
  CubeScene::Options options;
  options.isEnclosed = true;
  options.observationsPerPhoto = 20;
  return options;
}

struct Limits {
  std::vector<float> nears, fars, distances;
};

Limits drawLimits(const CubeScene& scene, const PhotoRays::Settings& settings) {
  const std::unique_ptr<Device> device = makeDevice({"cpu", 1});
  SceneFrame frame;
  frame.scale = 0.5;
  PhotoRays rays(*device, scene.capture(), frame, settings);
  rays.draw(0, kRays);
  return {device->read(rays.nears(0, kRays)), device->read(rays.fars(0, kRays)),
          device->read(rays.distances(0, kRays))};
}

TEST(PhotoRays, AreUnboundedByDefault) {
  const CubeScene scene(withPoints());
  PhotoRays::Settings settings;
  settings.sparseDepthRayFraction = 0.5;
  const Limits limits = drawLimits(scene, settings);
  EXPECT_EQ(limits.nears, std::vector<float>(kRays, 0.0f));
  EXPECT_EQ(limits.fars, std::vector<float>(kRays, std::numeric_limits<float>::infinity()));
  EXPECT_GT(std::count_if(limits.distances.begin(), limits.distances.end(), [](float d) { return d > 0; }), 800);
}

TEST(PhotoRays, DecodeOnlyThePhotosThatTheyAreDrawnFrom) {
  const CubeScene scene(withPoints());
  const std::unique_ptr<Device> device = makeDevice({"cpu", 1});
  // Tiles of two photos: the same rays, whether or not the other photos are there.
  std::vector<TileShares> tiles(scene.capture().photos.size());
  const std::vector<int> some = {scene.capture().photosIn(Split::train)[2], scene.capture().photosIn(Split::train)[5]};
  constexpr uint32_t kEdge = 8;
  for (const int photo : some)
    for (uint32_t top = 0; top < 3 * kEdge; top += kEdge)
      for (uint32_t left = kEdge; left < 4 * kEdge; left += kEdge) {
        if (left == 2 * kEdge && top == kEdge) continue;
        tiles[photo].tiles.push_back({photo, left, top, left + kEdge, top + kEdge});
        tiles[photo].until.push_back(tiles[photo].total() + 1);
      }
  PhotoRays::Settings settings;
  settings.sparseDepthRayFraction = 0.5;
  std::vector<RayBatch> batches;
  for (const bool isLimited : {false, true}) {
    if (isLimited) settings.photos = some;
    PhotoRays rays(*device, scene.capture(), {}, settings);
    rays.drawFrom(tiles);
    rays.draw(0, kRays);
    batches.push_back(rays.batch());
  }
  EXPECT_EQ(batches[0].pixels, batches[1].pixels);
  EXPECT_EQ(batches[0].photoOfRay, batches[1].photoOfRay);
  EXPECT_EQ(batches[0].targets, batches[1].targets);
  int known = 0;
  for (uint32_t ray = 0; ray < kRays; ++ray) {
    EXPECT_TRUE(std::find(some.begin(), some.end(), batches[1].photoOfRay[ray]) != some.end());
    const uint32_t x = static_cast<uint32_t>(batches[1].pixels[2 * size_t{ray}]),
                   y = static_cast<uint32_t>(batches[1].pixels[2 * size_t{ray} + 1]);
    EXPECT_TRUE(x >= kEdge && x < 4 * kEdge && y < 3 * kEdge && !(x / kEdge == 2 && y / kEdge == 1)) << x << " " << y;
    known += batches[1].distances[ray] > 0;
  }
  EXPECT_GT(known, 100);
}

TEST(PhotoRays, BeginAndEndAroundTheirSparsePoint) {
  const CubeScene scene(withPoints());
  PhotoRays::Settings settings;
  settings.sparseDepthRayFraction = 0.5;
  settings.sparseDepthMargin = 0.1;
  settings.nearFromSparseDepth = true;
  const Limits limits = drawLimits(scene, settings);
  int known = 0;
  for (uint32_t ray = 0; ray < kRays; ++ray) {
    const float distance = limits.distances[ray];
    if (distance > 0) {
      EXPECT_FLOAT_EQ(limits.nears[ray], 0.9f * distance);
      EXPECT_FLOAT_EQ(limits.fars[ray], 1.1f * distance);
      ++known;
    } else {
      EXPECT_GT(limits.nears[ray], 0.3f);  // cameras are 1.9 from the cube's centre, half of that in this frame
      EXPECT_LT(limits.nears[ray], 0.9f);
      EXPECT_TRUE(std::isinf(limits.fars[ray]));
    }
  }
  EXPECT_NEAR(known, kRays / 2, 150);
}

TEST(PhotoLoss, LeavesTransparentPixelsOutOnRequest) {
  const CubeScene scene;  // photos are transparent around the cube
  const std::unique_ptr<Device> device = makeDevice({"cpu", 1});
  PhotoRays rays(*device, scene.capture(), SceneFrame(), {});
  constexpr uint32_t kSome = 500;
  rays.draw(0, kSome);
  PhotoLoss loss(*device, scene.capture(), PhotoLossSettings(), kSome);
  Array<float> losses = device->array<float>(PhotoLoss::kLosses), opacities = device->array<float>(kSome);
  const Array<float> colours = device->uploadArray(std::vector<float>(3 * kSome, 2.0f));  // unlike any photo
  PhotoLoss::Picture picture{{kSome}, 0, kSome, colours, opacities};
  picture.standsBeforeBackgrounds = false;
  for (const bool all : {true, false}) {
    picture.comparesTransparent = all;
    loss.compare(rays, picture, losses);
    const std::vector<float> gradients = device->read(loss.colourGradients(picture));
    uint32_t transparent = 0;
    for (uint32_t ray = 0; ray < kSome; ++ray) {
      const bool isOpaque = rays.batch().opaqueWeights[ray] > 0;
      transparent += isOpaque ? 0 : 1;
      EXPECT_EQ(gradients[3 * ray] > 0, all || isOpaque) << ray;
    }
    EXPECT_GT(transparent, kSome / 10);
    EXPECT_LT(transparent, kSome * 9 / 10);
  }
}

}  // namespace
}  // namespace tessera
