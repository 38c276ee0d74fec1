#include "representations/hash/train/hash_trainer.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "representations/hash/testing/hash_cube.h"
#include "representations/hash/train/hash_model_renderer.h"

namespace tessera {
namespace {

double heldOutPsnr(const CubeScene& scene, HashModel& model) {
  HashModelRenderer renderer(model);
  return heldOutPsnr(scene, renderer);
}

TEST(HashTrainer, LearnsACubeInOneBlockAndInTwoThatMeetInIt) {
  const CubeScene scene;
  for (const int columns : {1, 2}) {
    TrainedHashCube trained(scene, smallHashConfig(), cubeGrid(columns), 300);
    EXPECT_GT(heldOutPsnr(scene, trained.model()), 24) << columns << " blocks";
  }
}

TEST(HashTrainer, LearnsWhatLiesAroundTheRegionInTheBackgroundBlock) {
  CubeScene::Options options;
  options.isEnclosed = true;  // walls at 2.5, far outside of the blocks
  const CubeScene scene(options);
  for (const char* backgroundBlock : {"own", "border"}) {
    HashConfig config = smallHashConfig();
    config.backgroundBlock = backgroundBlock;
    TrainedHashCube trained(scene, config, cubeGrid(), 300);
    EXPECT_EQ(trained.model().space().blocks(), backgroundBlock == std::string("own") ? 2u : 1u);
    EXPECT_GT(heldOutPsnr(scene, trained.model()), 20) << backgroundBlock;
  }
}

TEST(HashTrainer, RepeatsAStepThatExceededTheCapacityAsIfItHadBegunWithFewerRays) {
  const CubeScene scene;
  HashConfig config = smallHashConfig();
  config.exposure = true;
  config.samplesPerStep = 1 << 16;
  config.lattice = 64;
  config.texelsPerStep = 1 << 11;
  config.firstRays = config.maxRays;
  TrainedHashCube trained(scene, config, cubeGrid(), 0);
  const StepReport report = trained.trainer->step(0, 10);
  EXPECT_LT(report.rays, static_cast<uint32_t>(config.maxRays));
  EXPECT_LE(report.texels, trained.model().fields().texelCapacity());
  config.firstRays = static_cast<int>(report.rays);
  TrainedHashCube expected(scene, config, cubeGrid(), 0);
  EXPECT_EQ(expected.trainer->step(0, 10).texels, report.texels);
  EXPECT_EQ(expected.saved(), trained.saved());
}

TEST(HashTrainer, LearnsWithEveryWayToFuseLevels) {
  const CubeScene scene;
  for (const char* aggregation : {"attention", "sum", "mlp"}) {
    for (const char* attention : {"separate", "shared"}) {
      for (const bool varies : {true, false}) {
        HashConfig config = smallHashConfig();
        config.aggregation = aggregation;
        config.attention = attention;
        config.attentionVaries = varies;
        if (aggregation != std::string("attention") && (attention != std::string("separate") || !varies)) continue;
        TrainedHashCube trained(scene, config, cubeGrid(), 150);
        EXPECT_GT(heldOutPsnr(scene, trained.model()), 21) << aggregation << " " << attention << " " << varies;
      }
    }
  }
}

TEST(HashTrainer, LearnsABackgroundIfConfigured) {
  CubeScene::Options options;
  options.isEnclosed = true;
  const CubeScene scene(options);
  HashConfig config = smallHashConfig();
  config.background = "learned";
  TrainedHashCube trained(scene, config, cubeGrid(), 200);
  HashModelRenderer renderer(trained.model());
  const Camera& camera = scene.capture().cameras[0];
  const Pose& pose = scene.capture().photos[scene.capture().photosIn(Split::test)[0]].worldFromCamera;
  const RenderedView alone = renderer.render(camera, pose, nullptr);
  for (const float opacity : alone.opacity.pixels) ASSERT_EQ(opacity, 1);
  EXPECT_GT(computePsnr(alone, scene.truth(camera, pose)), 15);  // walls as a function of the direction alone
  // With an opaque object directly in front of the camera, nothing of the scene is visible.
  ImageF near(camera.width, camera.height, 1);
  std::fill(near.pixels.begin(), near.pixels.end(), 1e-3f);
  const RenderedView hidden = renderer.render(camera, pose, &near);
  for (const float opacity : hidden.opacity.pixels) ASSERT_EQ(opacity, 0);
  for (const float colour : hidden.colour.pixels) ASSERT_EQ(colour, 0);
}

TEST(HashTrainer, MakesTheSameBytesOnAnyNumberOfThreads) {
  const CubeScene scene;
  const HashConfig config = smallHashConfig();
  const std::vector<Bytes> one = TrainedHashCube(scene, config, cubeGrid(2), 40, 1).saved();
  EXPECT_EQ(one, TrainedHashCube(scene, config, cubeGrid(2), 40, 2).saved());
  EXPECT_EQ(one, TrainedHashCube(scene, config, cubeGrid(2), 40, 5).saved());
  HashConfig other = config;
  other.seed = 1;
  EXPECT_NE(one, TrainedHashCube(scene, other, cubeGrid(2), 40, 2).saved());
}

TEST(HashTrainer, GoesOnAfterRestoringAsIfNothingHadHappened) {
  const CubeScene scene;
  HashConfig config = smallHashConfig();
  constexpr int64_t kSteps = 60;
  TrainedHashCube unbroken(scene, config, cubeGrid(2), 0);
  for (int64_t step = 0; step < kSteps; ++step) unbroken.trainer->step(step, kSteps);
  std::vector<Bytes> state;
  for (int64_t step = 0; step < kSteps;) {
    TrainedHashCube part(scene, config, cubeGrid(2), 0);
    for (size_t k = 0; k < state.size(); ++k) {
      const auto file = decodeSafetensors(state[k]);
      ASSERT_TRUE(file);
      part.trainer->restore(static_cast<uint32_t>(k), "state", *file);
    }
    for (const int64_t until = step + 25; step < std::min(until, kSteps); ++step) part.trainer->step(step, kSteps);
    state = part.saved();
  }
  EXPECT_EQ(state, unbroken.saved());
}

TEST(HashTrainer, RefusesStatesOfOtherKindsAndSizes) {
  const CubeScene scene;
  TrainedHashCube small(scene, smallHashConfig(), cubeGrid(), 0);
  HashConfig larger = smallHashConfig();
  larger.fineLog2Size = 14;
  const Bytes other = TrainedHashCube(scene, larger, cubeGrid(), 0).saved()[0];
  EXPECT_THROW(small.trainer->restore(0, "state", *decodeSafetensors(other)), Error);
  TensorSet empty;
  EXPECT_THROW(small.trainer->restore(0, "state", *decodeSafetensors(empty.encode({{"format", "tessera field 1"}}))),
               Error);
}

// Invariant 12 of `hash` (docs/invariants.md).
TEST(HashTrainer, RaisesTheDistortionLossAsPlanned) {
  HashConfig config;
  config.distortionWeight = 0.01;
  config.lossWarmupFraction = 0.5;
  EXPECT_EQ(distortionWeight(config, 0, 100000), 0);
  EXPECT_NEAR(distortionWeight(config, 25000, 100000), 0.005, 1e-12);
  EXPECT_NEAR(distortionWeight(config, 50000, 100000), 0.01, 1e-12);
  EXPECT_NEAR(distortionWeight(config, 100000, 100000), 0.01, 1e-12);
  EXPECT_EQ(distortionWeight(config, 700, 0), 0);  // while the number of steps is unknown
  config.lossWarmupFraction = 0;
  EXPECT_EQ(distortionWeight(config, 0, 0), 0.01);
}

// Invariant 3 of `hash` (docs/invariants.md).
TEST(HashModel, ShortensItsStepsWhileRaysHaveTooFewSamples) {
  const std::unique_ptr<Device> device = makeDevice({"cpu", 1});
  HashModel model(*device, smallHashConfig(), cubeGrid());
  EXPECT_EQ(model.stepScale(), 1);
  model.adaptStep(2.9);
  EXPECT_NEAR(model.stepScale(), 0.999, 1e-12);
  model.adaptStep(3);
  EXPECT_NEAR(model.stepScale(), 0.999 * 1.001, 1e-12);
  for (int step = 0; step < 1505; ++step) model.adaptStep(0);
  EXPECT_GT(model.stepScale(), 0.2217);
  for (int step = 0; step < 10; ++step) model.adaptStep(0);
  EXPECT_EQ(model.stepScale(), 0.2217);
  for (int step = 0; step < 3000; ++step) model.adaptStep(50);
  EXPECT_EQ(model.stepScale(), 1);
}

}  // namespace
}  // namespace tessera
