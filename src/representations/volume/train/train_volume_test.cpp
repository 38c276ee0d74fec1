#include "representations/volume/train/train_volume.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "representations/volume/testing/volume_cube.h"
#include "representations/volume/train/volume_model_renderer.h"
#include "train/level_folders.h"
#include "train/run_folder.h"
#include "train/testing/two_devices.h"

namespace tessera {
namespace {

TrainVolumeOptions options(int64_t steps, bool resume = false) {
  TrainVolumeOptions settings;
  settings.config = smallVolumeConfig();
  settings.loop.steps = steps;
  settings.loop.resume = resume;
  settings.loop.progress = false;
  settings.blocks = *parseBlockCount("2x1");
  return settings;
}

std::vector<Bytes> checkpoints(const fs::path& model) {
  std::vector<Bytes> parts;
  const ModelManifest manifest = *ModelFolder(model).manifest();
  for (const std::string& file : manifest.files) parts.push_back(readFile(model / file));
  return parts;
}

TEST(TrainVolume, WritesAModelFolderThatLoads) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  const TrainingResult result = trainVolume(*device, scene.capture(), scene / "model", options(5));
  EXPECT_TRUE(result.finished);
  for (const char* file : {"config.toml", "blocks.json", "blocks.svg", "manifest.json", "metrics.jsonl"}) {
    EXPECT_TRUE(fs::exists(scene / "model" / file)) << file;
  }
  EXPECT_EQ(checkpoints(scene / "model").size(), 2u) << "one per block";
  const std::unique_ptr<VolumeModel> model = loadVolumeModel(*device, scene / "model");
  EXPECT_EQ(model->grid().columns, 2);
  EXPECT_EQ(model->grid().rows, 1);
  EXPECT_EQ(model->config().voxels, smallVolumeConfig().voxels);
}

TEST(TrainVolume, TrainsCoarserLevelsWithoutChangingTheFinest) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  TrainVolumeOptions finest = options(10);
  finest.config.lodStepFraction = 0;
  trainVolume(*device, scene.capture(), scene / "finest", finest);
  EXPECT_EQ(trainedLevels<VolumeConfig>(scene / "finest"), 1u);
  TrainVolumeOptions all = options(10);
  all.config.lodStepFraction = 0.8;
  EXPECT_TRUE(trainVolume(*device, scene.capture(), scene / "model", all).finished);
  EXPECT_EQ(checkpoints(scene / "model"), checkpoints(scene / "finest"));
  ASSERT_EQ(trainedLevels<VolumeConfig>(scene / "model"), 2u) << "two blocks, and one that holds both";
  const fs::path coarse = levelFolder(scene / "model", 1);
  EXPECT_EQ(ModelFolder(coarse).manifest()->plannedSteps, 8);
  const std::unique_ptr<VolumeModel> level = loadVolumeModel(*device, coarse);
  EXPECT_EQ(level->groups().groups(), 1u);
  EXPECT_EQ(level->virtualGrid().planes, static_cast<uint32_t>(smallVolumeConfig().planes) / 2);
  const std::unique_ptr<VolumeModel> below = loadVolumeModel(*device, scene / "model");
  EXPECT_NE(device->read(level->attributes().network(0).values.all()),
            device->read(below->attributes().network(0).values.all()));
}

TEST(TrainVolume, GivesEachCoarserLevelTwiceTheStepsUpToTheFinests) {
  VolumeConfig config;
  config.lodStepFraction = 0.3;
  EXPECT_EQ(levelSteps(config.lodStepFraction, 1, 1000), 300);
  EXPECT_EQ(levelSteps(config.lodStepFraction, 2, 1000), 600);
  EXPECT_EQ(levelSteps(config.lodStepFraction, 3, 1000), 1000);
  EXPECT_EQ(levelSteps(config.lodStepFraction, 9, 1000), 1000);
  config.lodStepFraction = 2;
  EXPECT_EQ(levelSteps(config.lodStepFraction, 1, 1000), 2000) << "or as many as are asked for";
  config.lodStepFraction = 0;
  EXPECT_EQ(levelSteps(config.lodStepFraction, 2, 1000), 0);
}

TEST(TrainVolume, TrainsLevelsWithSomeBlocksSwappedOut) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  TrainVolumeOptions few = options(10);
  few.config.residentBlocks = 1;
  few.config.residencySteps = 4;
  few.config.lodStepFraction = 0.8;
  EXPECT_TRUE(trainVolume(*device, scene.capture(), scene / "model", few).finished);
  // With a checkpoint after each step, those of swapped-out blocks are reused; the model is the same.
  TrainVolumeOptions often = few;
  often.loop.checkpointSeconds = 0;
  trainVolume(*device, scene.capture(), scene / "often", often);
  EXPECT_EQ(checkpoints(scene / "often"), checkpoints(scene / "model"));
  EXPECT_EQ(trainedLevels<VolumeConfig>(scene / "model"), 2u);
  for (const uint32_t level : {0u, 1u}) {
    const fs::path folder = levelFolder(scene / "model", level);
    EXPECT_FALSE(fs::exists(folder / "waiting"));
    const std::unique_ptr<VolumeModel> model = loadVolumeModel(*device, folder);
    EXPECT_EQ(model->slots(), 2u) << "loaded whole for rendering";
    EXPECT_EQ(model->attributes().table(0).counts.size(), 0u) << "without what only training needs";
  }
}

TEST(TrainVolume, ResumesWithItsOwnBlocksAndRejectsOthers) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  trainVolume(*device, scene.capture(), scene / "model", options(2));
  const auto goesOnWith = [&](const char* blocks) {
    TrainVolumeOptions more = options(3, true);
    more.blocks = *parseBlockCount(blocks);
    return trainVolume(*device, scene.capture(), scene / "model", more).finished;
  };
  try {
    goesOnWith("3x1");
    ADD_FAILURE() << "the blocks that were asked for are not there";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("the run has 2x1 blocks, not 3x1"), std::string::npos) << error.what();
  }
  EXPECT_TRUE(goesOnWith("auto"));
  EXPECT_TRUE(goesOnWith("2x1"));
}

TEST(TrainVolume, WarnsWhereStepsAreFewerThanACycleAndShortensCyclesOfLevels) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  const auto warnings = [&](const char* model, int64_t residencySteps) {
    TrainVolumeOptions few = options(10);
    few.config.residentBlocks = 1;
    few.config.residencySteps = residencySteps;
    few.config.lodStepFraction = 0.8;
    testing::internal::CaptureStderr();
    trainVolume(*device, scene.capture(), scene / model, few);
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_NE(warnings("short", 50).find("all blocks get their turn in 50 steps, and there are 10"), std::string::npos);
  EXPECT_EQ(savedConfig<VolumeConfig>(levelFolder(scene / "short", 1)).residencySteps, 8) << "all that it has";
  EXPECT_EQ(warnings("long", 4).find("get their turn"), std::string::npos);
  EXPECT_EQ(savedConfig<VolumeConfig>(levelFolder(scene / "long", 1)).residencySteps, 4);
}

TEST(TrainVolume, LoadsFewBlocksAtATime) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  TrainVolumeOptions three = options(4);
  three.blocks = *parseBlockCount("3x1");
  three.config.backgroundBlock = "own";
  trainVolume(*device, scene.capture(), scene / "model", three);
  const std::unique_ptr<VolumeModel> all = loadVolumeModel(*device, scene / "model");
  const std::unique_ptr<VolumeModel> few = loadVolumeModel(*device, scene / "model", 2);
  EXPECT_EQ(all->slots(), 4u);
  ASSERT_EQ(few->slots(), 3u) << "and the background block";
  EXPECT_EQ(device->read(few->deferred().values.all()), device->read(all->deferred().values.all()));
  const auto expectSame = [&](uint32_t block) {
    const uint32_t slot = few->findSlot(block);
    ASSERT_NE(slot, kNoSlot) << block;
    for (const auto fields : {&VolumeModel::attributes, &VolumeModel::proposals}) {
      BlockFields &ofAll = ((*all).*fields)(), &ofFew = ((*few).*fields)();
      EXPECT_EQ(device->read(ofFew.table(slot).values.all()), device->read(ofAll.table(block).values.all()));
      EXPECT_EQ(device->read(ofFew.network(slot).values.all()), device->read(ofAll.network(block).values.all()));
    }
  };
  for (const std::vector<uint32_t>& blocks : std::vector<std::vector<uint32_t>>{{0, 1}, {1, 2}, {0}, {2, 0}, {3, 1}}) {
    few->ensureResident(blocks);
    for (const uint32_t block : blocks) expectSame(block);
    expectSame(3);
  }
  few->ensureResident({0, 1});
  fs::remove(scene / "model" / ModelFolder(scene / "model").manifest()->files.at(2));
  EXPECT_THROW(few->ensureResident({2}), Error);
}

TEST(TrainVolume, ResumesALevelThatWasStopped) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  TrainVolumeOptions whole = options(6);
  whole.config.lodStepFraction = 2;
  trainVolume(*device, scene.capture(), scene / "unbroken", whole);
  TrainVolumeOptions stopped = whole;
  int64_t asked = 0;
  stopped.loop.stopRequested = [&] { return ++asked > 11; };
  EXPECT_FALSE(trainVolume(*device, scene.capture(), scene / "model", stopped).finished);
  EXPECT_EQ(trainedLevels<VolumeConfig>(scene / "model"), 1u);
  TrainVolumeOptions resumed = whole;
  resumed.loop.resume = true;
  EXPECT_TRUE(trainVolume(*device, scene.capture(), scene / "model", resumed).finished);
  EXPECT_EQ(checkpoints(levelFolder(scene / "model", 1)), checkpoints(levelFolder(scene / "unbroken", 1)));
}

TEST(TrainVolume, RetrainsLevelsWhereTheFinestWasTrainedFurther) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  const auto trained = [&](int64_t steps, bool resume) {
    TrainVolumeOptions settings = options(steps, resume);
    settings.config.lodStepFraction = 0.5;
    return settings;
  };
  const fs::path model = scene / "model";
  trainVolume(*device, scene.capture(), model, trained(8, false));
  ASSERT_EQ(trainedLevels<VolumeConfig>(model), 2u);
  TrainVolumeOptions stopped = trained(12, true);
  int64_t asked = 0;
  stopped.loop.stopRequested = [&] { return ++asked > 2; };
  EXPECT_FALSE(trainVolume(*device, scene.capture(), model, stopped).finished);
  EXPECT_EQ(trainedLevels<VolumeConfig>(model), 1u) << "made from the model as it was at step 8";
  EXPECT_TRUE(trainVolume(*device, scene.capture(), model, trained(12, true)).finished);
  EXPECT_EQ(trainedLevels<VolumeConfig>(model), 2u);
  EXPECT_EQ(savedConfig<VolumeConfig>(levelFolder(model, 1)).finestStep, 12);
  EXPECT_EQ(ModelFolder(levelFolder(model, 1)).manifest()->plannedSteps, 6);
}

TEST(TrainVolume, LeavesAModelThatItRejectsUnchanged) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  trainVolume(*device, scene.capture(), scene / "model", options(3));
  writeFileAtomically(scene / "model/blocks.svg", "mine");
  fs::create_directories(scene / "model/waiting");
  EXPECT_THROW(trainVolume(*device, scene.capture(), scene / "model", options(3)), Error);
  EXPECT_EQ(readTextFile(scene / "model/blocks.svg"), "mine");
  EXPECT_TRUE(fs::exists(scene / "model/waiting"));
}

TEST(TrainVolume, ResumesWhereItWasStopped) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  trainVolume(*device, scene.capture(), scene / "unbroken", options(12));
  TrainVolumeOptions stopped = options(12);
  int64_t asked = 0;
  stopped.loop.stopRequested = [&] { return ++asked > 5; };
  EXPECT_FALSE(trainVolume(*device, scene.capture(), scene / "model", stopped).finished);
  EXPECT_THROW(trainVolume(*device, scene.capture(), scene / "model", options(12)), Error) << "without resume";
  EXPECT_TRUE(trainVolume(*device, scene.capture(), scene / "model", options(12, true)).finished);
  EXPECT_EQ(checkpoints(scene / "model"), checkpoints(scene / "unbroken"));
}

TEST(TrainVolume, TakesTheBlocksOfAnotherModel) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  trainVolume(*device, scene.capture(), scene / "first", options(3));
  TrainVolumeOptions given = options(3);
  given.blocks = *parseBlockCount("1x1");
  given.grid = readGrid(scene / "first/blocks.json", scene.capture());
  trainVolume(*device, scene.capture(), scene / "second", given);
  EXPECT_EQ(checkpoints(scene / "second"), checkpoints(scene / "first"));
  EXPECT_EQ(readTextFile(scene / "second/blocks.json"), readTextFile(scene / "first/blocks.json"));
  EXPECT_TRUE(fs::exists(scene / "second/blocks.svg"));

  TrainVolumeOptions others = options(3, true);
  others.grid = given.grid;
  EXPECT_TRUE(trainVolume(*device, scene.capture(), scene / "second", others).finished);
  others.grid->edge *= 2;
  EXPECT_THROW(trainVolume(*device, scene.capture(), scene / "second", others), Error) << "resumed with other blocks";
}

TEST(TrainVolume, RejectsUnusableFolders) {
  CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  EXPECT_THROW(loadVolumeModel(*device, scene / "nowhere"), Error);
  writeFileAtomically(scene / "capture/transforms.json", "{}");
  EXPECT_THROW(trainVolume(*device, scene.capture(), scene / "capture", options(2)), Error);
  trainVolume(*device, scene.capture(), scene / "model", options(2));
  scene.capture().photos[0].split = Split::test;
  EXPECT_THROW(trainVolume(*device, scene.capture(), scene / "model", options(4, true)), Error) << "other photos";
  scene.capture().photos[0].split = Split::train;
  const fs::path file = scene / "model" / ModelFolder(scene / "model").manifest()->files.at(1);
  fs::resize_file(file, fs::file_size(file) / 2);
  EXPECT_THROW(loadVolumeModel(*device, scene / "model"), Error) << "a block that is cut short";
}

TEST(TrainVolume, EstimatesTheMemoryOfABlock) {
  const VolumeConfig cpu, paper = VolumeConfig::ofPreset("paper");
  EXPECT_GT(trainingBytesPerBlock(cpu), 5e6);
  EXPECT_LT(trainingBytesPerBlock(cpu), 100e6);
  EXPECT_GT(trainingBytesPerBlock(paper), 5 * trainingBytesPerBlock(cpu));
}

TwoDevices makeTrainings(const CubeScene& scene) {
  return {[&scene](Device& device, const fs::path& folder, const TrainingLoopOptions& loop) {
            TrainVolumeOptions some = options(0);
            some.config.lodStepFraction = 0;
            some.loop = loop;
            trainVolume(device, scene.capture(), folder, some);
          },
          [&scene](Device& device, const fs::path& folder) {
            const std::unique_ptr<VolumeModel> model = loadVolumeModel(device, folder);
            return VolumeModelRenderer(*model, 0)
                .render(scene.capture().cameras[0], scene.capture().photos[3].worldFromCamera, nullptr)
                .colour;
          }};
}

TEST(TrainVolume, TrainsTheSameModelOnVulkanAndResumesOnEitherDevice) {
  const CubeScene scene;
  makeTrainings(scene).expectTheSamePictures(scene / "models");
}

TEST(TrainVolume, LosesNothingWhereAGpuFails) {
  const CubeScene scene;
  makeTrainings(scene).expectToSurviveFailures(scene / "models");
}

TEST(TrainVolume, SubmitsEachStepToTheGpuAsOneBatch) {
#ifdef TESSERA_HAS_VULKAN
  SKIP_WITHOUT_VULKAN(openForTest());
  const CubeScene scene;
  const std::unique_ptr<Device> vulkan = makeVulkanDeviceWithFewGroups({});
  VolumeTrainer trainer(*vulkan, scene.capture(), smallVolumeConfig(), cubeGrid(), {});
  expectOneBatchAStep(*vulkan, trainer);
#endif
}

}  // namespace
}  // namespace tessera
