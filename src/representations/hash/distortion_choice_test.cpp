#include "representations/hash/distortion_choice.h"

#include <gtest/gtest.h>

#include "representations/hash/hash_cube.h"

namespace tessera {
namespace {

const auto goOn = [] { return false; };

TEST(DistortionChoice, TakesTheWeightThatIsClosestToPixelsThatWereLeftOut) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  DistortionProbing probing;
  probing.weights = {100, 1e-3};  // the first leaves nothing standing
  probing.steps = 60;
  HashConfig config = smallHashConfig();
  config.distortion.reset();
  const auto choice = chooseDistortion(*device, scene.capture(), config, cubeGrid(), probing, goOn);
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->steps, 60);
  ASSERT_EQ(choice->probes.size(), 2u);
  EXPECT_EQ(choice->probes[0].weight, 100);
  EXPECT_LT(choice->probes[0].psnr + 2, choice->probes[1].psnr);
  EXPECT_EQ(choice->weight(), 1e-3);
}

TEST(DistortionChoice, GivesAllProbesTheStepsThatTheFirstOneHasTimeFor) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  DistortionProbing probing;
  probing.weights = {1e-2, 1e-3};
  probing.minutes = 0.01;
  const auto choice = chooseDistortion(*device, scene.capture(), smallHashConfig(), cubeGrid(), probing, goOn);
  ASSERT_TRUE(choice);
  EXPECT_GE(choice->steps, 16);
  EXPECT_EQ(choice->probes.size(), 2u);
}

TEST(DistortionChoice, IsNoneWhenAskedToStop) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  DistortionProbing probing;
  probing.steps = 100;
  int64_t asked = 0;
  const auto stopSoon = [&] { return ++asked > 110; };
  EXPECT_FALSE(chooseDistortion(*device, scene.capture(), smallHashConfig(), cubeGrid(), probing, stopSoon));
  EXPECT_EQ(asked, 111);
}

// What it is judged by is neither learned from nor changed by looking.
TEST(HashTrainer, ComparesRaysWithoutLearningFromThem) {
  const CubeScene scene;
  TrainedHashCube trained(scene, smallHashConfig(), cubeGrid(), 50);
  const std::vector<Bytes> before = trained.saved();
  const HashTrainer::Fit fit = trained.trainer->fit(1000), again = trained.trainer->fit(1000);
  EXPECT_GT(fit.channels, 0);
  EXPECT_EQ(fit.squaredError, again.squaredError);
  EXPECT_EQ(trained.saved(), before);
  const double psnr = -10 * std::log10(fit.squaredError / fit.channels);
  EXPECT_NEAR(psnr, -10 * std::log10(trained.last.squaredError), 3);
}

}  // namespace
}  // namespace tessera
