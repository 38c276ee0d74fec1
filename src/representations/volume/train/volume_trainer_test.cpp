#include "representations/volume/train/volume_trainer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/order_statistics.h"
#include "representations/volume/testing/volume_cube.h"
#include "representations/volume/train/train_volume.h"
#include "representations/volume/train/volume_model_renderer.h"

namespace tessera {
namespace {

double heldOutPsnr(const CubeScene& scene, VolumeModel& model) {
  VolumeModelRenderer renderer(model, static_cast<float>(model.config().cullLast));
  return heldOutPsnr(scene, renderer);
}

TEST(VolumeTrainer, LearnsACubeInOneBlockAndInTwoThatMeetInIt) {
  const CubeScene scene;
  for (const int columns : {1, 2}) {
    TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(columns), 300);
    EXPECT_GT(heldOutPsnr(scene, trained.model()), 24) << columns << " blocks";
  }
}

TEST(VolumeTrainer, LearnsWhatLiesAroundTheRegionInTheBackgroundBlock) {
  CubeScene::Options options;
  options.isEnclosed = true;  // with walls at 2.5, far outside the blocks
  const CubeScene scene(options);
  for (const char* backgroundBlock : {"own", "border"}) {
    VolumeConfig config = smallVolumeConfig();
    config.backgroundBlock = backgroundBlock;
    TrainedVolumeCube trained(scene, config, cubeGrid(), 300);
    EXPECT_EQ(trained.model().space().blocks(), backgroundBlock == std::string("own") ? 2u : 1u);
    EXPECT_GT(heldOutPsnr(scene, trained.model()), 20) << backgroundBlock;
  }
}

TEST(VolumeTrainer, LearnsACubeAndItsSurroundingsWithThePapersPreset) {
  CubeScene::Options options;
  options.isEnclosed = true;
  const CubeScene scene(options);
  TrainedVolumeCube trained(scene, shrunk(VolumeConfig::ofPreset("paper")), cubeGrid(2), 300);
  EXPECT_EQ(trained.model().space().blocks(), 2u) << "no background block of its own";
  EXPECT_GT(heldOutPsnr(scene, trained.model()), 18);
}

// Returns the median absolute error of depth over all pixels of the held-out photos.
double depthError(const CubeScene& scene, VolumeModel& model) {
  VolumeModelRenderer renderer(model, static_cast<float>(model.config().cullLast));
  std::vector<float> errors;
  for (const int photo : scene.capture().photosIn(Split::test)) {
    const Camera& camera = scene.capture().cameras[0];
    const Pose& pose = scene.capture().photos[photo].worldFromCamera;
    const RenderedView seen = renderer.render(camera, pose, nullptr), truth = scene.truth(camera, pose);
    for (size_t i = 0; i < truth.depth.pixels.size(); ++i)
      errors.push_back(std::abs(seen.depth.pixels[i] - truth.depth.pixels[i]));
  }
  return upperMedian(errors);
}

TEST(VolumeTrainer, LearnsSurfacePositionsFromSparsePoints) {
  CubeScene::Options options;
  options.isEnclosed = true;
  options.observationsPerPhoto = 50;
  const CubeScene scene(options);
  VolumeConfig config = smallVolumeConfig();
  config.backgroundBlock = "own";
  const auto errorWith = [&](double sparseDepthRayFraction) {
    config.sparseDepthRayFraction = sparseDepthRayFraction;
    TrainedVolumeCube trained(scene, config, cubeGrid(2), 60);
    return depthError(scene, trained.model());
  };
  const double without = errorWith(0), with = errorWith(0.1);
  EXPECT_LT(with, 0.5 * without);
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

TEST(VolumeTrainer, ResumesExactlyAfterRestoring) {
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

// Settings for four blocks around the cube, of which two are in memory at a time.
VolumeConfig twoOfFour() {
  VolumeConfig config = smallVolumeConfig();
  config.residentBlocks = 2;
  config.residencySteps = 24;
  return config;
}

TEST(VolumeTrainer, LearnsACubeWithHalfOfItsBlocksInMemory) {
  const CubeScene scene;
  const VolumeConfig config = twoOfFour();
  constexpr int64_t kSteps = 400;
  TrainedVolumeCube few(scene, config, cubeGrid(2, 2), kSteps);
  EXPECT_EQ(few.model().slots(), 2u);
  ASSERT_NE(few.trainer->residency(), nullptr);
  EXPECT_GE(few.trainer->residency()->residentSets().size(), 4u) << "each pair of neighbours";
  // The model as it is loaded for rendering, with all blocks in memory.
  VolumeModel whole(*few.device, config, cubeGrid(2, 2));
  const std::vector<Bytes> parts = few.saved();
  ASSERT_EQ(parts.size(), 4u);
  for (uint32_t block = 0; block < 4; ++block) whole.restore(block, "state", *decodeSafetensors(parts[block]));
  // Nearly half of what the photos show is seen through three or four blocks and is excluded from training. With all
  // blocks in memory the PSNR is 23.5.
  EXPECT_NEAR(few.trainer->residency()->unserved(), 0.46, 0.1);
  EXPECT_GT(heldOutPsnr(scene, whole), 20.5);
}

// Blocks that are regularised before they have been trained on any photo become empty.
TEST(VolumeTrainer, StartsRegularisationAfterTheFirstCycleOfResidentSets) {
  const CubeScene scene;
  VolumeConfig config = twoOfFour(), urged = config;
  urged.lossWarmupFraction = 0;
  urged.opacityWeight = urged.distortionWeight = urged.sparsityWeight = 1;
  config.opacityWeight = config.distortionWeight = config.sparsityWeight = 0;
  TrainedVolumeCube calm(scene, config, cubeGrid(2, 2), 0), strict(scene, urged, cubeGrid(2, 2), 0);
  const int64_t cycle = calm.trainer->residency()->cycleSteps();
  for (int64_t step = 0; step <= cycle; ++step) {
    EXPECT_EQ(calm.saved(), strict.saved()) << "before step " << step;
    calm.trainer->step(step, 100);
    strict.trainer->step(step, 100);
  }
  EXPECT_NE(calm.saved(), strict.saved());
  // A coarser level starts from fields that have been trained, so its regularisation starts at once.
  for (VolumeConfig* level : {&config, &urged}) {
    *level = levelConfig(*level, 1, cycle);
    level->deferredOnlyFraction = 0;
  }
  TrainedVolumeCube calmLevel(scene, config, cubeGrid(2, 2), 0), strictLevel(scene, urged, cubeGrid(2, 2), 0);
  calmLevel.trainer->step(0, 100);
  strictLevel.trainer->step(0, 100);
  EXPECT_NE(calmLevel.saved(), strictLevel.saved());
}

TEST(VolumeTrainer, DrawsFewerRaysWhereTheirTexelsExceedTheCapacity) {
  const CubeScene scene;
  VolumeConfig config = smallVolumeConfig();
  config.texelsPerStep = 4096;
  config.sparsityPoints = 16;
  config.exposure = true;
  config.firstRays = config.maxRays;
  TrainedVolumeCube trained(scene, config, cubeGrid(), 0);
  const StepReport report = trained.trainer->step(0, 10);
  EXPECT_LE(report.texels, 6144u + 16 * VirtualGrid::kCorners);
  EXPECT_LT(report.rays, static_cast<uint32_t>(config.firstRays));
  EXPECT_GE(report.rays, 16u);
  // The result is a function of the step alone.
  TrainedVolumeCube again(scene, config, cubeGrid(), 0);
  EXPECT_EQ(again.trainer->step(0, 10).rays, report.rays);
  EXPECT_EQ(again.saved(), trained.saved());
  // The result is as if more rays had never been tried.
  config.firstRays = static_cast<int>(report.rays);
  TrainedVolumeCube meant(scene, config, cubeGrid(), 0);
  EXPECT_EQ(meant.trainer->step(0, 10).rays, report.rays);
  EXPECT_EQ(meant.saved(), trained.saved());
}

// Returns, for each ray of the last step, the blocks that are seen through its tile.
std::vector<std::vector<uint32_t>> blocksOfRays(const CubeScene& scene, TrainedVolumeCube& trained) {
  const TiledPhotos photos = tilePhotos(scene.capture(), trained.model().frame(), trained.model().space());
  const RayBatch& batch = trained.trainer->rays().batch();
  std::vector<std::vector<uint32_t>> blocks;
  for (size_t ray = 0; ray < batch.photoOfRay.size(); ++ray) {
    const float x = batch.pixels[2 * ray], y = batch.pixels[2 * ray + 1];
    for (size_t t = 0; t < photos.tiles.size(); ++t) {
      const PhotoTile& tile = photos.tiles[t];
      const bool inside = static_cast<float>(tile.left) <= x && x < static_cast<float>(tile.right) &&
                          static_cast<float>(tile.top) <= y && y < static_cast<float>(tile.bottom);
      if (inside && tile.photo == static_cast<int>(batch.photoOfRay[ray])) {
        blocks.push_back(photos.sets[photos.setOfTile[t]]);
      }
    }
  }
  return blocks;
}

TEST(VolumeTrainer, DrawsOnlyRaysThatSeeABlockWithBlocksOnly) {
  const CubeScene scene;
  BlockGrid part = cubeGrid();
  part.edge /= 4;
  part.bottom /= 4;
  part.top /= 4;
  const auto missing = [&](bool blocksOnly) {
    VolumeConfig config = smallVolumeConfig();
    config.blocksOnly = blocksOnly;
    TrainedVolumeCube trained(scene, config, part, 0);
    trained.trainer->step(0, 10);
    const std::vector<std::vector<uint32_t>> blocks = blocksOfRays(scene, trained);
    return std::count_if(blocks.begin(), blocks.end(), [](const auto& seen) { return seen.empty(); });
  };
  EXPECT_GT(missing(false), 100);
  EXPECT_EQ(missing(true), 0);
}

TEST(VolumeTrainer, DrawsNoRaysThatSeeABlockThatIsNotResident) {
  const CubeScene scene;
  TrainedVolumeCube trained(scene, twoOfFour(), cubeGrid(2, 2), 0);
  std::vector<int> raysOfBlock(4);
  const int64_t cycle = trained.trainer->residency()->cycleSteps();
  for (int64_t step = 0; step < cycle; ++step) {
    const StepReport report = trained.trainer->step(step, 100);
    const std::vector<uint32_t>& residentBlocks = trained.model().blockOfSlot();
    const std::vector<std::vector<uint32_t>> blocks = blocksOfRays(scene, trained);
    ASSERT_GE(blocks.size(), report.rays);
    for (const std::vector<uint32_t>& seen : blocks) {
      for (const uint32_t block : seen) {
        ASSERT_NE(std::find(residentBlocks.begin(), residentBlocks.end(), block), residentBlocks.end())
            << block << " in step " << step;
        ++raysOfBlock[block];
      }
    }
  }
  for (const int rays : raysOfBlock) EXPECT_GT(rays, 100) << "each has its share";
}

TEST(VolumeTrainer, TrainsOnlyDeferredNetworksWhileALevelIsFrozen) {
  const CubeScene scene;
  VolumeConfig config = levelConfig(smallVolumeConfig(), 1, 0);
  config.deferredOnlyFraction = 0.5;
  TrainedVolumeCube level(scene, config, cubeGrid(2), 0);
  const auto fields = [&] {
    std::vector<std::vector<float>> values;
    for (uint32_t slot = 0; slot < level.model().slots(); ++slot) {
      values.push_back(level.device->read(level.model().attributes().table(slot).values.all()));
      values.push_back(level.device->read(level.model().attributes().network(slot).values.all()));
      values.push_back(level.device->read(level.model().proposals().table(slot).values.all()));
    }
    return values;
  };
  const auto network = [&] { return level.device->read(level.model().deferred().values.all()); };
  const auto fieldsBefore = fields();
  const std::vector<float> networkBefore = network();
  for (int64_t step = 0; step < 5; ++step) level.trainer->step(step, 10);
  EXPECT_EQ(fields(), fieldsBefore);
  EXPECT_NE(network(), networkBefore);
  level.trainer->step(5, 10);
  EXPECT_NE(fields(), fieldsBefore);
}

// The exposures in the checkpoint of a model.
std::vector<float> savedExposures(const fs::path& model) {
  const Safetensors state = readSafetensors(model / ModelFolder(model).manifest()->files[0]);
  const auto values = state.require("state", "exposures", TensorType::f32).as<float>();
  return {values.begin(), values.end()};
}

TEST(VolumeTrainer, TrainsCoarserLevelsWithTheExposuresOfTheFinest) {
  const CubeScene scene;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  TrainVolumeOptions options;
  options.config = smallVolumeConfig();
  options.config.exposure = true;
  options.blocks = *parseBlockCount("2x1");
  options.loop.steps = 40;
  options.loop.progress = false;
  trainVolume(*device, scene.capture(), scene / "model", options);
  const std::vector<float> finest = savedExposures(scene / "model");
  EXPECT_NE(finest, std::vector<float>(finest.size(), 0.0f));
  EXPECT_EQ(savedExposures(levelFolder(scene / "model", 1)), finest);
}

TEST(VolumeTrainer, LeavesSwappedOutBlocksUnchanged) {
  const CubeScene scene;
  VolumeConfig config = twoOfFour();
  config.residencySteps = 4000;  // a single resident set for the whole test
  TrainedVolumeCube before(scene, config, cubeGrid(2, 2), 0);
  const std::vector<Bytes> first = before.saved();
  before.trainer.reset();  // both use the same swap folder
  TrainedVolumeCube after(scene, config, cubeGrid(2, 2), 12);
  const std::vector<uint32_t>& residentBlocks = after.model().blockOfSlot();
  const std::vector<Bytes> last = after.saved();
  for (uint32_t block = 0; block < 4; ++block) {
    const auto was = decodeSafetensors(first[block]), is = decodeSafetensors(last[block]);
    for (const char* name : {"attributes.table", "proposals.network"}) {
      const auto a = was->tensors.at(name).bytes, b = is->tensors.at(name).bytes;
      EXPECT_EQ(std::equal(a.begin(), a.end(), b.begin(), b.end()),
                std::find(residentBlocks.begin(), residentBlocks.end(), block) == residentBlocks.end())
          << name << " of block " << block;
    }
  }
}

TEST(VolumeTrainer, ResumesExactlyWithSwappedOutBlocks) {
  const CubeScene scene;
  for (const char* backgroundBlock : {"none", "own"}) {
    VolumeConfig config = twoOfFour();
    config.backgroundBlock = backgroundBlock;
    constexpr int64_t kSteps = 60;
    std::vector<Bytes> unbroken;
    {
      TrainedVolumeCube whole(scene, config, cubeGrid(2, 2), 0);
      for (int64_t step = 0; step < kSteps; ++step) whole.trainer->step(step, kSteps);
      unbroken = whole.saved();
    }
    EXPECT_FALSE(fs::exists(scene / "waiting")) << "the swap folder is removed";
    std::vector<Bytes> state;
    for (int64_t step = 0; step < kSteps;) {
      TrainedVolumeCube part(scene, config, cubeGrid(2, 2), 0);
      for (size_t k = 0; k < state.size(); ++k) {
        part.trainer->restore(static_cast<uint32_t>(k), "state", *decodeSafetensors(state[k]));
      }
      for (const int64_t until = step + 25; step < std::min(until, kSteps); ++step) part.trainer->step(step, kSteps);
      state = part.saved();
    }
    EXPECT_EQ(state, unbroken) << backgroundBlock;
  }
}

TEST(VolumeTrainer, NamesTheFirstNonFiniteBlock) {
  const CubeScene scene;
  TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(2), 1);
  EXPECT_EQ(trained.trainer->firstNonFinitePart(), std::nullopt);
  ParameterGroup& network = trained.model().attributes().network(1);
  std::vector<float> values = trained.device->read(network.values.all());
  values[5] = std::numeric_limits<float>::quiet_NaN();
  trained.device->write(network.values.all(), std::span<const float>(values));
  EXPECT_EQ(trained.trainer->firstNonFinitePart(), 1u);
}

TEST(VolumeTrainer, RejectsCheckpointsOfOtherFormats) {
  const CubeScene scene;
  TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(), 0);
  const auto other = decodeSafetensors(encodeSafetensors({}, {{"format", "tessera field 1"}}));
  ASSERT_TRUE(other);
  EXPECT_THROW(trained.trainer->restore(0, "file", *other), Error);
}

// A block that no ray reaches keeps its parameters.
TEST(VolumeTrainer, DoesNotChangeBlocksThatNoRayReaches) {
  const CubeScene scene;
  BlockGrid grid = cubeGrid(2);
  grid.originInWorld.x() += 0.7 + 1.4;  // the cube is in no block, and no camera sees it behind the grid
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
