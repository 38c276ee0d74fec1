#include "representations/field/train/field_trainer.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/error.h"
#include "representations/field/testing/trained_cube.h"
#include "representations/field/train/field_renderer.h"

namespace tessera {
namespace {

double heldOutPsnr(const CubeScene& scene, TrainedCube& trained) {
  FieldRenderer renderer(trained.trainer->model());
  return heldOutPsnr(scene, renderer);
}

std::string catchErrorMessage(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(FieldTrainer, LearnsWhatHeldOutPhotosSee) {
  const CubeScene scene;
  TrainedCube trained(scene, cubeConfig(), 300);
  EXPECT_GT(heldOutPsnr(scene, trained), 17);
}

TEST(FieldTrainer, LearnsASceneWithoutBounds) {
  CubeScene::Options options;
  options.isEnclosed = true;
  const CubeScene scene(options);
  TrainedCube trained(scene, cubeConfig(), 300);
  EXPECT_GT(heldOutPsnr(scene, trained), 17);
}

TEST(FieldTrainer, LearnsABoundedScene) {
  const CubeScene scene;
  FieldConfig config = cubeConfig();
  config.contracted = false;
  TrainedCube trained(scene, config, 300);
  EXPECT_GT(heldOutPsnr(scene, trained), 17);
}

TEST(FieldTrainer, LearnsFromFisheyePhotos) {
  CubeScene::Options options;
  options.lens = LensModel::openCvFisheye;
  const CubeScene scene(options);
  TrainedCube trained(scene, cubeConfig(), 300);
  EXPECT_GT(heldOutPsnr(scene, trained), 17);
}

TEST(FieldTrainer, LeavesTheSpaceInFrontOfItsCamerasEmpty) {
  CubeScene::Options options;
  options.isEnclosed = true;
  const CubeScene scene(options);
  for (const int seed : {1, 3}) {  // without scaled gradients, fog reduces the PSNR to 14 and 12 dB
    FieldConfig config = cubeConfig();
    config.near = 0.05;
    config.seed = seed;
    TrainedCube trained(scene, config, 300);
    EXPECT_GT(heldOutPsnr(scene, trained), 17) << seed;
  }
}

TEST(FieldTrainer, LearnsWithEveryLoss) {
  const CubeScene scene;
  for (const char* loss : {"mse", "huber", "charbonnier"}) {
    FieldConfig config = cubeConfig();
    config.loss = loss;
    TrainedCube trained(scene, config, 120);
    EXPECT_GT(heldOutPsnr(scene, trained), 15) << loss;
  }
}

TEST(FieldTrainer, MakesTheSameBytesOnAnyNumberOfThreads) {
  CubeScene::Options options;
  options.isEnclosed = true;
  options.stain = true;
  const CubeScene scene(options);
  FieldConfig config = cubeConfig();
  for (const int samplesPerMicroBatch : {8192, 1000}) {  // one micro-batch; nine, some of which have no ray at first
    config.samplesPerMicroBatch = samplesPerMicroBatch;
    config.firstRays = samplesPerMicroBatch == 1000 ? 4 : 512;
    const Bytes one = TrainedCube(scene, config, 80, 1).trainer->save(0);
    EXPECT_EQ(one, TrainedCube(scene, config, 80, 2).trainer->save(0));
    EXPECT_EQ(one, TrainedCube(scene, config, 80, 5).trainer->save(0));
    FieldConfig other = config;
    other.seed = 1;
    EXPECT_NE(one, TrainedCube(scene, other, 80, 2).trainer->save(0));
  }
}

TEST(FieldTrainer, LearnsAsWellInSeveralMicroBatches) {
  const CubeScene scene;
  FieldConfig config = cubeConfig();
  config.samplesPerMicroBatch = 1000;
  TrainedCube trained(scene, config, 300);
  EXPECT_GT(heldOutPsnr(scene, trained), 17);
  EXPECT_GT(trained.last.samples, 8192u / 2);
}

TEST(FieldTrainer, GoesOnAfterRestoringAsIfNothingHadHappened) {
  const CubeScene scene;
  constexpr int64_t kSteps = 90;
  FieldConfig plain = cubeConfig();
  plain.photoBudgetMiB = CubeScene::kWidth * CubeScene::kHeight * 4 * 5 / 1048576.0;  // the photo window moves, too
  FieldConfig microBatches = cubeConfig();
  microBatches.samplesPerMicroBatch = 1000;
  FieldConfig crowded = cubeConfig();  // thousands of steps a ray: not all rays of a step are finished
  crowded.minStep = 0.001;
  crowded.cone = 0;
  crowded.far = 8;
  for (const FieldConfig& config : {plain, microBatches, crowded}) {
    TrainedCube unbroken(scene, config, 0);
    for (int64_t step = 0; step < kSteps; ++step) unbroken.trainer->step(step, kSteps);
    Bytes state;
    int64_t step = 0;
    for (const int64_t until : {0, 1, 15, 16, 17, 50, 90}) {
      TrainedCube part(scene, config, 0);
      if (!state.empty()) {
        const auto file = decodeSafetensors(state);
        ASSERT_TRUE(file);
        part.trainer->restore(0, "state", *file);
      }
      for (; step < until; ++step) part.trainer->step(step, kSteps);
      state = part.trainer->save(0);
    }
    EXPECT_EQ(state, unbroken.trainer->save(0));
  }
}

TEST(FieldTrainer, DrawsFewerRaysWhenTheyDoNotFit) {
  const CubeScene scene;
  FieldConfig config = cubeConfig();
  config.minStep = 0.001;
  config.cone = 0;
  config.far = 8;
  config.firstRays = 4096;
  TrainedCube trained(scene, config, 0);
  const StepReport first = trained.trainer->step(0, 0);
  EXPECT_GT(first.rays, 0u);
  EXPECT_LT(first.rays, 4096u);
  const auto file = decodeSafetensors(trained.trainer->save(0));
  ASSERT_TRUE(file);
  EXPECT_LT(file->require("state", "rays", TensorType::u32).as<uint32_t>()[0], first.rays + 8);
}

// Returns the mean of |expected - true| z-depth over the pixels of the held-out photos.
double heldOutDepthError(const CubeScene& scene, TrainedCube& trained) {
  FieldRenderer renderer(trained.trainer->model());
  double sum = 0;
  int count = 0;
  for (const int index : scene.capture().photosIn(Split::test)) {
    const Photo& photo = scene.capture().photos[index];
    const Camera& camera = scene.capture().cameras[photo.camera];
    const RenderedView view = renderer.render(camera, photo.worldFromCamera, nullptr);
    const RenderedView truth = scene.truth(camera, photo.worldFromCamera);
    for (size_t i = 0; i < truth.depth.pixels.size(); ++i, ++count) {
      sum += std::abs(view.depth.pixels[i] - truth.depth.pixels[i]);
    }
  }
  return sum / count;
}

TEST(FieldTrainer, LearnsFromSparsePointsWhereSurfacesAre) {
  CubeScene::Options options;
  options.isEnclosed = true;
  options.photos = 10;
  options.observationsPerPhoto = 150;
  const CubeScene scene(options);
  FieldConfig with = cubeConfig(), without = cubeConfig();
  with.depthWeight = 0.5;
  without.depthWeight = 0;
  TrainedCube taught(scene, with, 200), untaught(scene, without, 200);
  EXPECT_LT(heldOutDepthError(scene, taught), 0.7 * heldOutDepthError(scene, untaught));
}

TEST(FieldTrainer, TrainsOnAllPhotosWhenFewFitTheBudget) {
  const CubeScene scene;
  FieldConfig config = cubeConfig();
  config.photoBudgetMiB = CubeScene::kWidth * CubeScene::kHeight * 4 * 4 / 1048576.0;
  config.stepsPerPhoto = 1;
  config.exposure = true;  // each photo's exposure counts its steps
  TrainedCube trained(scene, config, 200);
  const auto file = decodeSafetensors(trained.trainer->save(0));
  ASSERT_TRUE(file);
  const auto counts = file->require("state", "exposures.count", TensorType::u32).as<uint32_t>();
  for (size_t i = 0; i < scene.capture().photos.size(); ++i) {
    if (scene.capture().photos[i].split == Split::train) {
      EXPECT_GT(counts[3 * i], 2u) << i;
      EXPECT_LT(counts[3 * i], 40u) << i;
    } else {
      EXPECT_EQ(counts[3 * i], 0u) << i;  // held-out photos are never trained on
    }
  }
  EXPECT_GT(heldOutPsnr(scene, trained), 15);
}

TEST(FieldTrainer, IgnoresMaskedPixels) {
  CubeScene::Options options;
  options.isEnclosed = true;
  options.stain = true;
  const CubeScene scene(options);
  CubeScene bare(options);
  for (Photo& photo : bare.capture().photos) photo.mask.clear();
  TrainedCube masked(scene, cubeConfig(), 250), stained(bare, cubeConfig(), 250);
  const double psnr = heldOutPsnr(scene, masked);
  EXPECT_GT(psnr, 16);
  EXPECT_GT(psnr, heldOutPsnr(bare, stained) + 2);
}

TEST(FieldTrainer, RecoversTheExposuresOfPhotos) {
  CubeScene::Options options;
  options.isEnclosed = true;
  options.log2Gains = {-0.3, 0.25, 0.05};
  const CubeScene scene(options);
  FieldConfig config = cubeConfig();
  config.exposure = true;
  config.exposureLearningRate = 8e-3;
  TrainedCube trained(scene, config, 400);
  const auto file = decodeSafetensors(trained.trainer->save(0));
  ASSERT_TRUE(file);
  const auto gains = file->require("state", "exposures", TensorType::f32).as<float>();
  const std::vector<int> photos = scene.capture().photosIn(Split::train);
  for (int channel = 0; channel < 3; ++channel) {
    double mean[3] = {}, count[3] = {};  // for the photos with each gain
    for (const int photo : photos) {
      mean[photo % 3] += gains[3 * photo + channel];
      ++count[photo % 3];
    }
    EXPECT_NEAR(mean[0] + mean[1] + mean[2], 0, 0.05 * static_cast<double>(photos.size()));  // no overall gain
    for (int i = 0; i < 3; ++i) mean[i] /= count[i];
    EXPECT_NEAR(mean[1] - mean[0], 0.55, 0.15) << channel;
    EXPECT_NEAR(mean[2] - mean[0], 0.35, 0.15) << channel;
  }
}

TEST(FieldTrainer, LeavesExposuresAtZeroIfTheyAreDisabled) {
  const CubeScene scene;
  FieldConfig config = cubeConfig();
  config.exposure = false;
  TrainedCube trained(scene, config, 20);
  const auto file = decodeSafetensors(trained.trainer->save(0));
  ASSERT_TRUE(file);
  for (const float gain : file->require("state", "exposures", TensorType::f32).as<float>()) EXPECT_EQ(gain, 0);
}

TEST(FieldTrainer, AdaptsItsRaysToTheTargetNumberOfSamples) {
  const CubeScene scene;
  TrainedCube trained(scene, cubeConfig(), 150);
  EXPECT_GT(trained.last.samples, 8192u / 2);
  EXPECT_LE(trained.last.samples, 8192u * 2);
  EXPECT_NE(trained.last.rays, 512u);  // the number of the first step
  EXPECT_LE(trained.last.rays, 4096u);
  EXPECT_GE(trained.last.marched, trained.last.samples);
}

TEST(FieldTrainer, RefusesWhatItCannotTrain) {
  CubeScene scene;
  FieldConfig config = cubeConfig();
  config.loss = "hinge";
  EXPECT_NE(catchErrorMessage([&] { TrainedCube(scene, config, 0); }).find("hinge"), std::string::npos);
  for (Photo& photo : scene.capture().photos) photo.split = Split::test;
  EXPECT_NE(catchErrorMessage([&] { TrainedCube(scene, cubeConfig(), 0); }).find("no photo"), std::string::npos);
}

TEST(FieldTrainer, RefusesCheckpointsThatAreNotItsOwn) {
  const CubeScene scene;
  TrainedCube trained(scene, cubeConfig(), 2);
  const Bytes bytes = trained.trainer->save(0);
  for (int change = 0; change < 3; ++change) {
    FieldConfig config = cubeConfig();
    if (change == 0) config.gridLog2Size = 12;
    if (change == 1) config.width = 32;
    if (change == 2) config.occupancyResolution = 16;
    TrainedCube other(scene, config, 0);
    const auto file = decodeSafetensors(bytes);
    ASSERT_TRUE(file);
    const std::string error = catchErrorMessage([&] { other.trainer->restore(0, "some/step-2.safetensors", *file); });
    EXPECT_NE(error.find("some/step-2.safetensors"), std::string::npos) << change << ": " << error;
  }
  CubeScene::Options more;
  more.photos = 49;
  const CubeScene larger(more);
  TrainedCube another(larger, cubeConfig(), 0);
  EXPECT_NE(catchErrorMessage([&] { another.trainer->restore(0, "s", *decodeSafetensors(bytes)); }), "no error");
  const std::vector<float> zero = {0};
  const auto foreign =
      decodeSafetensors(encodeSafetensors({{"table", {TensorType::f32, {1}, std::as_bytes(std::span(zero))}}}));
  EXPECT_NE(catchErrorMessage([&] { another.trainer->restore(0, "s", *foreign); }).find("--method field"),
            std::string::npos);
}

}  // namespace
}  // namespace tessera
