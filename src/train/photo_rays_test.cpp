#include "train/photo_rays.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

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

}  // namespace
}  // namespace tessera
