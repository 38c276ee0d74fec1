#include "representations/hash/train/distortion_choice.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "representations/hash/testing/hash_cube.h"
#include "train/held_out_photos.h"

namespace tessera {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

TEST(DistortionChoice, TakesTheWeightWithTheBestPsnrOnPhotosThatWereLeftOut) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  DistortionSearch probing;
  probing.weights = {100, 0.01, 30};  // two of these destroy the scene
  probing.steps = 60;
  size_t done = 0;
  probing.probed = [&](const DistortionChoice& choice) { EXPECT_EQ(choice.probes.size(), ++done); };
  HashConfig config = smallHashConfig();
  config.distortionWeight.reset();
  const auto choice = chooseDistortion(*device, scene.capture(), config, cubeGrid(), probing);
  ASSERT_TRUE(choice);
  EXPECT_EQ(done, 3u);
  EXPECT_EQ(choice->steps, 60);
  ASSERT_EQ(choice->probes.size(), 3u);
  EXPECT_EQ(choice->probes[0].weight, 100);
  EXPECT_LT(*choice->probes[0].psnr + 2, *choice->probes[1].psnr);
  EXPECT_EQ(choice->weight(), 0.01);
}

// The photos that are left out are painted over: training on them, or evaluating on others, would give a different
// PSNR.
TEST(DistortionChoice, TrainsOnTheOtherPhotosAloneAndEvaluatesOnThoseLeftOut) {
  CubeScene scene;
  const HashConfig config = smallHashConfig();
  DistortionSearch probing;
  probing.weights = {0.03};
  probing.steps = 40;
  const HeldOutPhotos photos =
      holdOutPhotos(scene.capture(), probing.holdOutInterval, static_cast<uint64_t>(config.seed));
  for (size_t i = 0; i < scene.capture().photos.size(); ++i) {
    if (photos.heldOut[i].total() == 0) continue;
    ImageU8 image(CubeScene::kWidth, CubeScene::kHeight, 3);
    for (size_t k = 0; k < image.pixels.size(); ++k) image.pixels[k] = k % 3 == 1 ? 0 : 255;  // magenta
    writePng(scene.capture().photos[i].image, image);
  }
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  const auto choice = chooseDistortion(*device, scene.capture(), config, cubeGrid(), probing);
  ASSERT_TRUE(choice);

  HashConfig probed = config;
  probed.distortionWeight = 0.03;
  HashTrainer trainer(*device, scene.capture(), probed, cubeGrid());
  trainer.trainOn(photos.trained);
  for (int64_t step = 0; step < 40; ++step) trainer.step(step, 40);
  const HashTrainer::Evaluation learned = trainer.evaluate(40);
  trainer.evaluateOn(photos.heldOut);
  HashTrainer::Evaluation judged;
  for (int64_t batch = 0; batch < 40; ++batch) {
    // All 41 photos are in memory at some time within 82 steps.
    const HashTrainer::Evaluation evaluation = trainer.evaluate(40 + 3 * batch);
    judged.squaredError += evaluation.squaredError;
    judged.channels += evaluation.channels;
  }
  EXPECT_EQ(choice->probes[0].psnr, computePsnr(judged));
  EXPECT_GT(*computePsnr(learned), *computePsnr(judged) + 5) << "the model has not learned magenta";
}

TEST(DistortionChoice, GivesAllProbesTheStepsThatTheFirstOneHasTimeFor) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  DistortionSearch probing;
  probing.weights = {0.001, 0.01};
  probing.minutes = 0.01;
  probing.minSteps = 32;
  int64_t asked = 0;  // before each step, and before each batch that is evaluated
  probing.stopRequested = [&] { return ++asked < 0; };
  const auto choice = chooseDistortion(*device, scene.capture(), smallHashConfig(), cubeGrid(), probing);
  ASSERT_TRUE(choice);
  EXPECT_GE(choice->steps, 32);
  EXPECT_EQ(asked, 2 * (choice->steps + std::min<int64_t>(64, choice->steps)));
}

// Otherwise the first probe would have no distortion loss until the number of its steps is known.
TEST(DistortionChoice, TrainsAllProbesAlikeIfTheWeightRisesDuringTraining) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  HashConfig config = smallHashConfig();
  config.lossWarmupFraction = 0.5;
  DistortionSearch probing;
  probing.weights = {0.03, 0.03};
  probing.minutes = 0.01;
  probing.minSteps = 32;
  const auto choice = chooseDistortion(*device, scene.capture(), config, cubeGrid(), probing);
  ASSERT_TRUE(choice);
  EXPECT_GE(choice->steps, 32);
  EXPECT_EQ(choice->probes[0].psnr, choice->probes[1].psnr);
}

TEST(DistortionChoice, DoesNotRepeatKnownProbes) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  DistortionSearch probing;
  probing.weights = {0.001, 0.01};
  probing.steps = 40;
  probing.known = {20, {{0.001, 99}}};
  int64_t asked = 0;
  probing.stopRequested = [&] { return ++asked < 0; };
  const auto choice = chooseDistortion(*device, scene.capture(), smallHashConfig(), cubeGrid(), probing);
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->probes.size(), 2u);
  EXPECT_EQ(choice->weight(), 0.001);
  EXPECT_EQ(choice->steps, 20) << "as many as the known probe";
  EXPECT_EQ(asked, 20 + 20);
}

TEST(DistortionChoice, IsEmptyIfStoppedWhileTrainingOrEvaluating) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  for (const int64_t last : {25, 45}) {
    DistortionSearch probing;
    probing.weights = {0.01};
    probing.steps = 30;
    int64_t asked = 0;
    probing.stopRequested = [&] { return ++asked > last; };
    EXPECT_FALSE(chooseDistortion(*device, scene.capture(), smallHashConfig(), cubeGrid(), probing));
    EXPECT_EQ(asked, last + 1);
  }
}

TEST(DistortionChoice, IsTheLargestOfEquallyGoodWeights) {
  const double near = DistortionChoice::kAsGood / 2, far = 2 * DistortionChoice::kAsGood;
  EXPECT_EQ((DistortionChoice{10, {{0.3, 20 - far}, {1, 20.0}, {3, 20 - near}, {10, 20 - far}}}).weight(), 3);
  EXPECT_EQ((DistortionChoice{10, {{3, 20.0}, {1, 20 - near}}}).weight(), 3) << "in any order";
  EXPECT_EQ((DistortionChoice{10, {{1, 20.0}, {3, 20 - far}}}).weight(), 1);
}

TEST(DistortionChoice, TakesNoWeightWithWhichTrainingDiverged) {
  EXPECT_EQ(computePsnr(HashTrainer::Evaluation{kNone, 300, 0}), std::nullopt);
  EXPECT_EQ(*computePsnr(HashTrainer::Evaluation{3, 300, 0}), 20);
  DistortionChoice choice{10, {{0.3, std::nullopt}, {1, -4.0}, {3, std::nullopt}}};
  EXPECT_EQ(choice.weight(), 1);
  choice.probes.erase(choice.probes.begin() + 1);
  EXPECT_THROW(choice.weight(), Error);
  EXPECT_THROW(computePsnr(HashTrainer::Evaluation{0, 0, 0}), Error) << "there are no pixels";
}

TEST(DistortionChoice, ThrowsIfAllTrainingsDiverged) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  HashConfig config = smallHashConfig();
  config.learningRate = 1e9;
  config.networkL2 = 1e9;
  DistortionSearch probing;
  probing.minutes = 0.05;
  probing.weights = {0.01};
  const auto choice = chooseDistortion(*device, scene.capture(), config, cubeGrid(), probing);
  ASSERT_TRUE(choice);
  EXPECT_FALSE(choice->probes[0].psnr);
  EXPECT_THROW(choice->weight(), Error);
}

// The exposures of photos that are left out stay at the mean of the others.
TEST(DistortionChoice, EvaluatesWithTheMeanOfTheLearnedExposures) {
  CubeScene::Options options;
  options.log2Gains = {0.4, -0.4};
  const CubeScene scene(options);
  HashConfig config = smallHashConfig();
  config.exposure = true;
  config.exposureLearningRate = 0.05;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  HashTrainer trainer(*device, scene.capture(), config, cubeGrid());
  const HeldOutPhotos photos = holdOutPhotos(scene.capture(), 10, 0);
  trainer.trainOn(photos.trained);
  for (int64_t step = 0; step < 40; ++step) trainer.step(step, 40);
  trainer.evaluateOn(photos.heldOut);
  const Bytes state = trainer.save(0);
  const auto file = decodeSafetensors(state);
  ASSERT_TRUE(file);
  const std::span<const float> gains = file->require("state", "exposures", TensorType::f32).as<float>();
  double sum = 0;
  for (size_t photo = 0; photo < photos.trained.size(); ++photo) {
    const bool isTrained = photos.trained[photo].total() > 0;
    for (size_t c = 0; c < 3; ++c) {
      if (!isTrained) {
        EXPECT_EQ(gains[3 * photo + c], 0) << photo;
      }
      sum += isTrained ? gains[3 * photo + c] : 0;
    }
  }
  EXPECT_NEAR(sum, 0, 1e-3);
  EXPECT_GT(*std::max_element(gains.begin(), gains.end()), 0.05);
}

// Evaluation neither trains the model nor changes its own result.
TEST(HashTrainer, EvaluatesRaysWithoutLearningFromThem) {
  const CubeScene scene;
  TrainedHashCube trained(scene, smallHashConfig(), cubeGrid(), 50);
  const std::vector<Bytes> before = trained.saved();
  const HashTrainer::Evaluation once = trained.trainer->evaluate(1000), again = trained.trainer->evaluate(1000);
  EXPECT_GT(once.channels, 0);
  EXPECT_EQ(once.squaredError, again.squaredError);
  EXPECT_EQ(trained.saved(), before);
  EXPECT_NEAR(*computePsnr(once), -10 * std::log10(trained.last.squaredError), 3);
}

}  // namespace
}  // namespace tessera
