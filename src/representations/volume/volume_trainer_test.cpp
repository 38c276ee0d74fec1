#include "representations/volume/volume_trainer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "representations/volume/volume_cube.h"
#include "representations/volume/volume_model_renderer.h"

namespace tessera {
namespace {

// Mean PSNR over the held-out views.
double heldOut(const CubeScene& scene, VolumeModel& model) {
  VolumeModelRenderer renderer(model, static_cast<float>(model.config().cullLast));
  double sum = 0;
  const std::vector<int> photos = scene.capture().photosIn(Split::test);
  for (const int photo : photos) {
    const Camera& camera = scene.capture().cameras[0];
    const Pose& pose = scene.capture().photos[photo].worldFromCamera;
    sum += psnrOf(renderer.render(camera, pose, nullptr), scene.truth(camera, pose));
  }
  return sum / static_cast<double>(photos.size());
}

TEST(VolumeTrainer, LearnsACubeInOneBlockAndInTwoThatMeetInIt) {
  const CubeScene scene;
  for (const int columns : {1, 2}) {
    TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(columns), 300);
    EXPECT_GT(heldOut(scene, trained.model()), 24) << columns << " blocks";
  }
}

TEST(VolumeTrainer, LearnsWhatLiesAroundTheRegionInTheSurround) {
  CubeScene::Options options;
  options.room = true;  // walls at 2.5, far outside of the blocks
  const CubeScene scene(options);
  for (const char* surround : {"own", "border"}) {
    VolumeConfig config = smallVolumeConfig();
    config.surround = surround;
    TrainedVolumeCube trained(scene, config, cubeGrid(), 300);
    EXPECT_EQ(trained.model().space().blocks(), surround == std::string("own") ? 2u : 1u);
    EXPECT_GT(heldOut(scene, trained.model()), 20) << surround;
  }
}

TEST(VolumeTrainer, MakesTheSameBytesOnAnyNumberOfThreads) {
  const CubeScene scene;
  const VolumeConfig config = smallVolumeConfig();
  const std::vector<Bytes> one = TrainedVolumeCube(scene, config, cubeGrid(2), 40, 1).saved();
  EXPECT_EQ(one, TrainedVolumeCube(scene, config, cubeGrid(2), 40, 2).saved());
  EXPECT_EQ(one, TrainedVolumeCube(scene, config, cubeGrid(2), 40, 5).saved());
  VolumeConfig other = config;
  other.seed = 1;
  EXPECT_NE(one, TrainedVolumeCube(scene, other, cubeGrid(2), 40, 2).saved());
}

TEST(VolumeTrainer, GoesOnAfterRestoringAsIfNothingHadHappened) {
  const CubeScene scene;
  const VolumeConfig config = smallVolumeConfig();
  constexpr int64_t kSteps = 60;
  TrainedVolumeCube unbroken(scene, config, cubeGrid(2), 0);
  for (int64_t step = 0; step < kSteps; ++step) unbroken.trainer->step(step, kSteps);
  std::vector<Bytes> state;
  for (int64_t step = 0; step < kSteps;) {
    TrainedVolumeCube part(scene, config, cubeGrid(2), 0);
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

TEST(VolumeTrainer, NamesTheBlockThatIsBroken) {
  const CubeScene scene;
  TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(2), 1);
  EXPECT_EQ(trained.trainer->brokenPart(), 0u);
  ParameterGroup& network = trained.model().attributes().network(1);
  std::vector<float> values = trained.device->read(network.values.all());
  values[5] = std::numeric_limits<float>::quiet_NaN();
  trained.device->write(network.values.all(), std::span<const float>(values));
  EXPECT_EQ(trained.trainer->brokenPart(), 1u);
}

TEST(VolumeTrainer, RefusesCheckpointsOfOtherKinds) {
  const CubeScene scene;
  TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(), 0);
  const auto other = decodeSafetensors(encodeSafetensors({}, {{"format", "tessera field 1"}}));
  ASSERT_TRUE(other);
  EXPECT_THROW(trained.trainer->restore(0, "file", *other), Error);
}

// An untouched block costs nothing: its parameters are what they were.
TEST(VolumeTrainer, LeavesBlocksAloneThatNoRayComesTo) {
  const CubeScene scene;
  BlockGrid grid = cubeGrid(2);
  grid.originInWorld.x() += 0.7 + 1.4;  // the cube is in no block, and behind the grid for nobody
  grid.originInWorld.z() += 40;
  VolumeConfig config = smallVolumeConfig();
  config.sparsityPoints = 0;
  TrainedVolumeCube before(scene, config, grid, 0), after(scene, config, grid, 20);
  for (uint32_t block = 0; block < 2; ++block) {
    EXPECT_EQ(before.device->read(before.model().attributes().table(block).values.all()),
              after.device->read(after.model().attributes().table(block).values.all()));
  }
}

TEST(VolumeTrainer, RaisesTheCullThresholdAsPlanned) {
  VolumeConfig config;
  EXPECT_EQ(cullThreshold(config, 0), 0);
  EXPECT_EQ(cullThreshold(config, config.cullBegin - 1e-6), 0);
  EXPECT_NEAR(cullThreshold(config, config.cullBegin), config.cullFirst, 1e-9);
  EXPECT_NEAR(cullThreshold(config, (config.cullBegin + config.cullEnd) / 2),
              std::sqrt(config.cullFirst * config.cullLast), 1e-7);
  EXPECT_NEAR(cullThreshold(config, config.cullEnd), config.cullLast, 1e-9);
  EXPECT_NEAR(cullThreshold(config, 1), config.cullLast, 1e-9);
}

}  // namespace
}  // namespace tessera
