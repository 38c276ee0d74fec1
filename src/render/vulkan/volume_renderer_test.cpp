#include "render/vulkan/volume_renderer.h"

#include <gtest/gtest.h>

#include "gpu/test_context.h"
#include "render/cpu/scene_renderer.h"
#include "render/made_place.h"

namespace tessera {
namespace {

Camera camera() {
  Camera camera;
  camera.width = 50;
  camera.height = 37;
  camera.parameters = {47, 47, 25, 18};
  return camera;
}

// A flight over and through the place.
Pose poseAt(int step) {
  const double angle = 0.021 * step;
  const Vec3d eye(5 * std::cos(angle), 4 * std::sin(1.7 * angle), 1.2 + std::sin(0.9 * angle));
  const Vec3d target(2 * std::sin(angle), std::cos(2 * angle), -0.5);
  Pose pose;
  const Vec3d forward = (target - eye).normalized(), right = forward.cross(Vec3d::UnitZ()).normalized();
  pose.rotation.col(0) = right;
  pose.rotation.col(1) = forward.cross(right);
  pose.rotation.col(2) = forward;
  pose.translation = eye;
  return pose;
}

double decibels(const ImageF& a, const ImageF& b) {
  double squares = 1e-12, largest = 1e-6;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    squares += std::pow(a.pixels[i] - b.pixels[i], 2);
    largest = std::max<double>(largest, std::abs(b.pixels[i]));
  }
  return 10 * std::log10(static_cast<double>(a.pixels.size()) * largest * largest / squares);
}

class GpuVolumeRendererTest : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
  }
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }

  // Both renderers along a flight.
  void compare(uint64_t budget, double mostPixels, const ImageF* opaqueDepth) {
    SceneRendererSettings settings;
    settings.budgetBytes = budget;
    settings.selection.mostPixels = mostPixels;
    VolumeRenderer oracle(place().frame, place().tree, place().source(), settings);
    GpuRendererSettings ofCard;
    ofCard.budgetBytes = budget;
    ofCard.selection = settings.selection;
    GpuVolumeRenderer card(context_, {place().frame, place().tree, place().source(), {}}, ofCard);
    for (int step = 0; step < 600; step += 60) {
      SCOPED_TRACE(step);
      const RenderedView wanted = oracle.render(camera(), poseAt(step), opaqueDepth);
      const RenderedView got = card.render(camera(), poseAt(step), opaqueDepth);
      EXPECT_GT(decibels(got.colour, wanted.colour), 60);
      EXPECT_GT(decibels(got.opacity, wanted.opacity), 60);
      EXPECT_GT(decibels(got.depth, wanted.depth), 50);
      ASSERT_EQ(card.cut().tiles.size(), oracle.cut().tiles.size());
      for (size_t i = 0; i < oracle.cut().tiles.size(); ++i) {
        EXPECT_EQ(card.cut().tiles[i].content, oracle.cut().tiles[i].content);
      }
      EXPECT_LE(card.cache().statistics().mostBytes, budget);
    }
  }

  std::shared_ptr<GpuContext> context_;
};

TEST_F(GpuVolumeRendererTest, DrawsWhatTheProcessorDraws) {
  compare(place().allBytes, 1.5, nullptr);
}

TEST_F(GpuVolumeRendererTest, DrawsTheSameCutWithinABudget) {
  compare(place().finestBytes / 3, 0.5, nullptr);
}

TEST_F(GpuVolumeRendererTest, EndsRaysWhereSomethingOpaqueStands) {
  ImageF opaque(camera().width, camera().height, 1, INFINITY);
  for (int y = 0; y < opaque.height; ++y) {
    for (int x = 0; x < opaque.width / 2; ++x) *opaque.at(x, y) = 3;
  }
  compare(place().allBytes, 16, &opaque);
}

TEST_F(GpuVolumeRendererTest, FollowsCamerasOfOtherSizes) {
  GpuVolumeRenderer card(context_, {place().frame, place().tree, place().source(), {}}, {});
  EXPECT_EQ(card.render(camera(), poseAt(0), nullptr).colour.width, 50);
  EXPECT_EQ(card.render(camera().scaledTo(20, 11), poseAt(0), nullptr).opacity.pixels.size(), 220u);
}

}  // namespace
}  // namespace tessera
