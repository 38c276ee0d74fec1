#include "representations/hash/train/train_hash.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "render/tile_scene.h"
#include "representations/hash/bake/bake_hash.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/hash/testing/hash_cube.h"
#include "representations/hash/testing/hash_renderer.h"
#include "representations/hash/train/hash_model_renderer.h"
#include "train/level_folders.h"
#include "train/testing/two_devices.h"

namespace tessera {
namespace {

class HashTraining : public testing::Test {
 protected:
  HashTraining() : device_(makeDevice({"cpu", 2})) {}

  TrainHashOptions options(int64_t steps, bool resume = false) const {
    TrainHashOptions options;
    options.config = smallHashConfig();
    options.config.lattice = 32;
    options.config.lodStepFraction = 0.5;
    options.grid = cubeGrid(2);
    options.loop.steps = steps;
    options.loop.resume = resume;
    return options;
  }

  TwoDevices trainings() const {
    return {[this](Device& device, const fs::path& folder, const TrainingLoopOptions& loop) {
              TrainHashOptions some = options(0);
              some.config.lodStepFraction = 0;
              some.loop = loop;
              trainHash(device, scene_.capture(), folder, some);
            },
            [this](Device& device, const fs::path& folder) {
              const std::unique_ptr<HashModel> model = loadHashModel(device, folder);
              return HashModelRenderer(*model)
                  .render(scene_.capture().cameras[0], scene_.capture().photos[3].worldFromCamera, nullptr)
                  .colour;
            }};
  }

  TrainingResult train(const TrainHashOptions& options) {
    return trainHash(*device_, scene_.capture(), scene_ / "model", options);
  }

  const CubeScene scene_;
  const std::unique_ptr<Device> device_;
};

TEST(HashLevels, HaveHalfTheLatticeOneFineLevelFewerAndAQuarterOfTheEntries) {
  HashConfig finest;
  const HashConfig coarse = levelConfig(finest, 1, 100), coarsest = levelConfig(finest, 9, 100);
  EXPECT_EQ(coarse.lattice, finest.lattice / 2);
  EXPECT_EQ(coarse.fineLevels, finest.fineLevels - 1);
  EXPECT_EQ(coarse.fineLog2Size, finest.fineLog2Size - 2);
  EXPECT_EQ(coarse.lod, 1);
  EXPECT_EQ(coarse.finestStep, 100);
  coarse.check();
  coarsest.check();
  EXPECT_EQ(coarsest.lattice, 8);
  EXPECT_EQ(coarsest.fineLevels, 1);
}

TEST_F(HashTraining, MakesCoarserLevelsOfTheSameBlocks) {
  TrainHashOptions exposed = options(60);
  exposed.config.exposure = true;
  const TrainingResult result = train(exposed);
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.step, 60);
  const fs::path model = scene_ / "model";
  ASSERT_EQ(trainedLevels<HashConfig>(model), 2u) << "two blocks, and a tile that holds both";
  const HashConfig coarse = savedConfig<HashConfig>(levelFolder(model, 1));
  EXPECT_EQ(coarse.lattice, 16);
  EXPECT_EQ(coarse.finestStep, 60);
  EXPECT_EQ(ModelFolder(levelFolder(model, 1)).manifest()->step, 30);
  const auto exposures = [](const fs::path& folder) {
    const Safetensors state = readSafetensors(folder / ModelFolder(folder).manifest()->files[0]);
    const auto values = state.require("state", "exposures", TensorType::f32).as<float>();
    return std::vector<float>(values.begin(), values.end());
  };
  EXPECT_NE(exposures(model), std::vector<float>(exposures(model).size(), 0.0f));
  EXPECT_EQ(exposures(levelFolder(model, 1)), exposures(model));

  // Both levels are rendered, the coarser one in one tile of two parts.
  const HashLevelModels models = [&](uint32_t level) { return loadHashModel(*device_, levelFolder(model, level)); };
  const BakedScene baked = bakeHash(models, 2, scene_.capture(), scene_ / "scene", {});
  ASSERT_EQ(baked.levels.size(), 2u);
  EXPECT_LT(baked.levels[1].bytesInMemory, baked.levels[0].bytesInMemory / 2);
  EXPECT_EQ(baked.tileset.tiles.size(), 3u);
  EXPECT_GT(baked.tileset.root().geometricError, 1.9 * baked.tileset.tiles[1].geometricError);
  for (const int level : {0, 1}) {
    TileScene opened = openTileScene(scene_ / "scene", hashCodec());
    EXPECT_EQ(contentAs<HashContent>(*opened.source.load(0)).parts.size(), 2u);
    SceneRendererSettings settings;
    settings.threads = 2;
    settings.selection.maximumScreenSpaceError = 0;
    settings.selection.finestLevel = level;
    HashRenderer renderer(opened.frame, std::move(opened.tree), std::move(opened.source), settings);
    const Photo& photo = scene_.capture().photos[0];
    const RenderedView view =
        renderer.render(scene_.capture().cameras[static_cast<size_t>(photo.camera)], photo.worldFromCamera, nullptr);
    float maximum = 0;
    for (const float opacity : view.opacity.pixels) maximum = std::max(maximum, opacity);
    EXPECT_GT(maximum, 0.3f) << level;
    for (const SelectedTile& tile : renderer.cut().tiles) EXPECT_EQ(tile.content == 0, level == 1);
  }
}

TEST_F(HashTraining, RetrainsCoarserLevelsWhenTheFinestWasTrainedFurther) {
  train(options(20));
  const fs::path model = scene_ / "model";
  ASSERT_EQ(trainedLevels<HashConfig>(model), 2u);
  TrainHashOptions finestAlone = options(40, true);
  finestAlone.config.lodStepFraction = 0;
  train(finestAlone);
  EXPECT_EQ(trainedLevels<HashConfig>(model), 1u) << "made from the model as it was at step 20";
  train(options(40, true));
  EXPECT_EQ(trainedLevels<HashConfig>(model), 2u);
  EXPECT_EQ(savedConfig<HashConfig>(levelFolder(model, 1)).finestStep, 40);
}

// A level is incomplete if training was killed or files were deleted.
TEST_F(HashTraining, TrainsALevelThatIsIncomplete) {
  train(options(20));
  const fs::path level = levelFolder(scene_ / "model", 1);
  const Bytes unbroken = readFile(level / ModelFolder(level).manifest()->files[0]);
  fs::remove(level / "manifest.json");
  fs::remove_all(level / "blocks");
  EXPECT_EQ(trainedLevels<HashConfig>(scene_ / "model"), 1u);
  train(options(20, true));
  ASSERT_EQ(trainedLevels<HashConfig>(scene_ / "model"), 2u);
  EXPECT_EQ(readFile(level / ModelFolder(level).manifest()->files[0]), unbroken);
}

TEST_F(HashTraining, RejectsStepsThatScenesCannotHaveBeforeItTrains) {
  TrainHashOptions wide = options(20);
  wide.config.maxRayStep = 3;  // allowed with 32 corners, too long with 16
  EXPECT_THROW(train(wide), Error);
  EXPECT_FALSE(fs::exists(scene_ / "model" / "manifest.json"));
  wide.config.lodStepFraction = 0;
  train(wide);
}

TEST_F(HashTraining, TrainsNoCoarserLevelsIfTheyAreDisabled) {
  TrainHashOptions alone = options(10);
  alone.config.lodStepFraction = 0;
  train(alone);
  EXPECT_EQ(trainedLevels<HashConfig>(scene_ / "model"), 1u);
  EXPECT_FALSE(fs::exists(scene_ / "model" / "levels"));
}

TEST_F(HashTraining, TrainsTheSameModelOnVulkanAndResumesOnEitherDevice) {
  trainings().expectTheSamePictures(scene_ / "models");
}

TEST_F(HashTraining, LosesNothingWhereAGpuFails) {
  trainings().expectToSurviveFailures(scene_ / "models");
}

TEST_F(HashTraining, SubmitsEachStepToTheGpuAsOneBatch) {
#ifdef TESSERA_HAS_VULKAN
  SKIP_WITHOUT_VULKAN(openForTest());
  const std::unique_ptr<Device> vulkan = makeVulkanDeviceWithFewGroups({});
  HashTrainer trainer(*vulkan, scene_.capture(), smallHashConfig(), cubeGrid());
  expectOneBatchAStep(*vulkan, trainer);
#endif
}

}  // namespace
}  // namespace tessera
