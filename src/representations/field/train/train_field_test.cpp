#include "representations/field/train/train_field.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "representations/field/testing/trained_cube.h"
#include "representations/field/train/field_renderer.h"
#include "train/run_folder.h"
#include "train/testing/two_devices.h"

namespace tessera {
namespace {

TrainFieldOptions options(int64_t steps, bool resume = false) {
  TrainFieldOptions result;
  result.config = cubeConfig();
  result.loop.steps = steps;
  result.loop.resume = resume;
  result.loop.progress = false;
  return result;
}

Bytes checkpoint(const fs::path& model) {
  return readFile(model / ModelFolder(model).manifest()->files.at(0));
}

TEST(TrainField, EndsWithTheSameBytesHoweverOftenItIsStopped) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  trainField(*device, scene.capture(), scene / "unbroken", options(60));
  for (const int64_t stopAfter : {1, 7, 8, 30, 100}) {
    TrainFieldOptions some = options(60, true);
    some.config = savedConfig<FieldConfig>(scene / "broken");
    if (stopAfter == 1) some.config = cubeConfig();
    int64_t asked = 0;
    some.loop.stopRequested = [&] { return asked++ >= stopAfter; };
    const std::unique_ptr<Device> another = makeDevice({"cpu", stopAfter % 2 == 0 ? 1 : 3});
    trainField(*another, scene.capture(), scene / "broken", some);
  }
  EXPECT_EQ(ModelFolder(scene / "broken").manifest()->step, 60);
  EXPECT_EQ(checkpoint(scene / "broken"), checkpoint(scene / "unbroken"));
}

TEST(TrainField, LeavesAFolderThatCanBeRepeatedAndRendered) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  TrainFieldOptions some = options(12);
  some.config.seed = 42;
  trainField(*device, scene.capture(), scene / "model", some);
  FieldConfig saved = savedConfig<FieldConfig>(scene / "model");
  EXPECT_EQ(configToToml(saved.fields()), configToToml(some.config.fields()));
  // The model that is loaded from the folder renders the same image as the one that was trained.
  const std::unique_ptr<FieldModel> loaded = loadFieldModel(*device, scene / "model");
  TrainedCube trained(scene, some.config, 12);
  FieldRenderer fromFolder(*loaded), fromTraining(trained.trainer->model());
  const Photo& photo = scene.capture().photos[3];
  EXPECT_EQ(fromFolder.render(scene.capture().cameras[0], photo.worldFromCamera, nullptr).colour.pixels,
            fromTraining.render(scene.capture().cameras[0], photo.worldFromCamera, nullptr).colour.pixels);
}

TEST(TrainField, DoesNotChangeTheSettingsOfAModelThatItRefusesToTrain) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  trainField(*device, scene.capture(), scene / "model", options(3));
  const std::string before = readTextFile(scene / "model/config.toml");
  TrainFieldOptions other = options(5);
  other.config.seed = 9;
  EXPECT_THROW(trainField(*device, scene.capture(), scene / "model", other), Error);
  EXPECT_EQ(readTextFile(scene / "model/config.toml"), before);
}

TEST(TrainField, StaysInItsFrameWhenTheCaptureHasChanged) {
  CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  trainField(*device, scene.capture(), scene / "model", options(3));
  const SceneFrame before = ModelFolder(scene / "model").readPlacement().frame;
  for (int i = 0; i < 500; ++i) scene.capture().points.push_back({Vec3d(i, 3 * i % 100, 5), {}, 0});
  trainField(*device, scene.capture(), scene / "model", options(5, true));
  const SceneFrame after = ModelFolder(scene / "model").readPlacement().frame;
  EXPECT_EQ(before.centre, after.centre);
  EXPECT_EQ(before.scale, after.scale);
  EXPECT_EQ(ModelFolder(scene / "model").manifest()->step, 5);
}

TEST(TrainField, GoesOnOnlyWithTheCaptureThatItBeganWith) {
  CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  trainField(*device, scene.capture(), scene / "model", options(3));
  const Bytes before = checkpoint(scene / "model");
  scene.capture().photos[0].split = Split::test;
  EXPECT_THROW(trainField(*device, scene.capture(), scene / "model", options(5, true)), Error);
  EXPECT_EQ(checkpoint(scene / "model"), before);
  scene.capture().photos[0].split = Split::train;
  trainField(*device, scene.capture(), scene / "model", options(5, true));
  EXPECT_EQ(ModelFolder(scene / "model").manifest()->step, 5);
}

TEST(TrainField, LimitsPhotosToTheirShareOfMemoryIfNotAllFit) {
  const CubeScene scene;
  const std::vector<int> photos = scene.capture().photosIn(Split::train);
  const int64_t all = static_cast<int64_t>(photos.size()) * CubeScene::kWidth * CubeScene::kHeight * 4;
  ASSERT_EQ(decodedBytes(scene.capture(), photos), static_cast<size_t>(all));
  EXPECT_EQ(resolvePhotoBudget(0, scene.capture(), static_cast<double>(all)), 0);
  const double minimum = resolvePhotoBudget(0, scene.capture(), static_cast<double>(all) - 1);
  EXPECT_GT(minimum, 0);
  EXPECT_LE(minimum * 1048576, static_cast<double>(all) - 1);
  EXPECT_EQ(resolvePhotoBudget(0.5, scene.capture(), 1000), 0.5);
}

TEST(TrainField, NamesACheckpointThatIsBroken) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  trainField(*device, scene.capture(), scene / "model", options(3));
  const fs::path file = scene / "model" / ModelFolder(scene / "model").manifest()->files.at(0);
  const Bytes whole = readFile(file);
  for (const size_t length : {size_t{0}, size_t{7}, whole.size() / 2, whole.size() - 1}) {
    writeFileAtomically(file, std::span(whole).first(length));
    for (const bool training : {true, false}) {
      try {
        if (training) {
          trainField(*device, scene.capture(), scene / "model", options(5, true));
        } else {
          loadFieldModel(*device, scene / "model");
        }
        FAIL() << "no error";
      } catch (const Error& error) {
        EXPECT_EQ(error.subject(), file.string()) << error.what();
      }
    }
  }
}

TEST(TrainField, ThrowsIfThereIsNoModelToRender) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  EXPECT_THROW(loadFieldModel(*device, scene / "nothing"), Error);
}

TwoDevices makeTrainings(const CubeScene& scene) {
  return {[&scene](Device& device, const fs::path& folder, const TrainingLoopOptions& loop) {
            TrainFieldOptions some = options(0);
            some.loop = loop;
            trainField(device, scene.capture(), folder, some);
          },
          [&scene](Device& device, const fs::path& folder) {
            const std::unique_ptr<FieldModel> model = loadFieldModel(device, folder);
            return FieldRenderer(*model)
                .render(scene.capture().cameras[0], scene.capture().photos[3].worldFromCamera, nullptr)
                .colour;
          }};
}

TEST(TrainField, TrainsTheSameModelOnVulkanAndResumesOnEitherDevice) {
  const CubeScene scene;
  makeTrainings(scene).expectTheSamePictures(scene / "models");
}

TEST(TrainField, LosesNothingWhereAGpuFails) {
  const CubeScene scene;
  makeTrainings(scene).expectToSurviveFailures(scene / "models");
}

TEST(TrainField, SubmitsEachStepToTheGpuAsOneBatch) {
#ifdef TESSERA_HAS_VULKAN
  SKIP_WITHOUT_VULKAN(openForTest());
  const CubeScene scene;
  const std::unique_ptr<Device> vulkan = makeVulkanDeviceWithFewGroups({});
  FieldConfig config = options(0).config;
  config.occupancyEvery = 16;
  FieldTrainer trainer(*vulkan, scene.capture(), config, fitSceneFrame(scene.capture(), 1.5));
  expectOneBatchAStep(*vulkan, trainer);
#endif
}

}  // namespace
}  // namespace tessera
