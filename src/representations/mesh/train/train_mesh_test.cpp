#include "representations/mesh/train/train_mesh.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "base/error.h"
#include "base/file.h"
#include "representations/mesh/testing/small_mesh.h"
#include "representations/mesh/train/mesh_renderer.h"
#include "train/photo_window.h"
#include "train/run_folder.h"
#include "train/testing/cube_scene.h"

namespace tessera {
namespace {

constexpr int64_t kSteps = 20;

TrainMeshOptions smallOptions() {
  TrainMeshOptions options;
  options.config = smallMeshConfig();
  options.config.coarseSteps = 20;
  options.config.meshCells = 16;
  options.blocks = {false, 2, 1};
  options.loop.steps = kSteps;
  options.loop.progress = false;
  options.loop.checkpointSeconds = 1e6;
  return options;
}

// Returns the last checkpoints of all parts and of the coarse field.
std::map<std::string, Bytes> lastCheckpoints(const fs::path& mesh) {
  std::map<std::string, Bytes> files;
  std::vector<fs::path> folders = {mesh / "coarse"};
  for (const auto& entry : fs::directory_iterator(mesh / "parts")) folders.push_back(entry.path());
  for (const fs::path& folder : folders) {
    const auto manifest = ModelFolder(folder).manifest();
    if (!manifest) continue;
    files[folder.filename().string()] = readFile(folder / manifest->files.at(0));
  }
  return files;
}

class TrainMesh : public testing::Test {
 protected:
  TrainMesh() : device(makeDevice({"cpu", 2})) {}
  TrainingResult train(const std::string& name, const TrainMeshOptions& options) {
    return trainMesh(*device, scene.capture(), scene / name, options);
  }

  const CubeScene scene;
  const std::unique_ptr<Device> device;
};

TEST_F(TrainMesh, EndsWithTheSameBytesHoweverOftenItIsStopped) {
  EXPECT_TRUE(train("whole", smallOptions()).finished);
  const auto whole = lastCheckpoints(scene / "whole");
  ASSERT_EQ(whole.size(), 4u) << "coarse field, two blocks, background block";

  TrainMeshOptions options = smallOptions();
  int stops = 0;
  for (bool finished = false; !finished; ++stops) {
    ASSERT_LT(stops, 20);
    int asked = 0;
    options.loop.stopRequested = [&] { return ++asked > 11 * (stops + 1); };
    finished = train("stopped", options).finished;
    options.loop.resume = true;
    options.loop.steps = 0;  // as the run had planned
  }
  EXPECT_GT(stops, 4);
  options.loop.stopRequested = [] { return true; };
  EXPECT_TRUE(train("stopped", options).finished) << "there is nothing to do";
  EXPECT_EQ(lastCheckpoints(scene / "stopped"), whole);
  EXPECT_EQ(requireManifest(ModelFolder(scene / "stopped")).step, 2 * kSteps + kSteps * 15 / 100);
}

TEST_F(TrainMesh, TrainsPartsAloneToTheSameBytes) {
  EXPECT_TRUE(train("whole", smallOptions()).finished);
  TrainMeshOptions options = smallOptions();
  options.only = {"coarse"};
  EXPECT_TRUE(train("apart", options).finished);
  EXPECT_THROW(loadTrainedMesh(*device, scene / "apart"), Error) << "nothing but the coarse field";
  options.loop.resume = true;
  for (const std::vector<std::string>& only :
       std::vector<std::vector<std::string>>{{"block_1_0"}, {"background", "block_0_0"}}) {
    options.only = only;
    EXPECT_TRUE(train("apart", options).finished);
  }
  EXPECT_EQ(lastCheckpoints(scene / "apart"), lastCheckpoints(scene / "whole"));
}

TEST_F(TrainMesh, StatesHowTheCoarseFieldWasTrained) {
  TrainMeshOptions options = smallOptions();
  options.only = {"coarse"};
  const TrainingResult first = train("mesh", options);
  EXPECT_TRUE(first.finished);
  EXPECT_EQ(first.step, options.config.coarseSteps);
  EXPECT_EQ(first.plannedSteps, options.config.coarseSteps);
  EXPECT_GT(first.psnr.value_or(0), 3);
  EXPECT_GT(first.seconds, 0);
  EXPECT_GT(first.samplesPerSecond, 0);
  EXPECT_GT(first.samplesPerRay, 0);
  options.loop.resume = true;
  const TrainingResult second = train("mesh", options);
  EXPECT_TRUE(second.finished);
  EXPECT_EQ(second.step, options.config.coarseSteps);
  EXPECT_FALSE(second.psnr.has_value()) << "nothing was trained";
  EXPECT_EQ(second.samplesPerSecond, 0);
}

TEST_F(TrainMesh, TrainsAFinishedRunOfStepsForMinutes) {
  TrainMeshOptions options = smallOptions();
  options.only = {"coarse", "block_1_0"};
  EXPECT_TRUE(train("mesh", options).finished);
  options.loop.resume = true;
  options.loop.steps = 0;
  options.loop.minutes = 0.05;
  const TrainingResult longer = train("mesh", options);
  EXPECT_TRUE(longer.finished);
  EXPECT_GT(longer.step, kSteps);
  EXPECT_TRUE(longer.psnr.has_value());
  const auto checkpoints = lastCheckpoints(scene / "mesh");
  EXPECT_EQ(train("mesh", options).step, longer.step) << "it has been trained for minutes, as planned";
  EXPECT_EQ(lastCheckpoints(scene / "mesh"), checkpoints);
}

TEST_F(TrainMesh, StatesWhatIsLeftToTrain) {
  using testing::ElementsAre;
  TrainMeshOptions options = smallOptions();
  options.only = {"coarse", "block_1_0"};
  EXPECT_TRUE(train("mesh", options).finished);
  const auto findUnfinished = [&] { return StoredMesh(*device, scene / "mesh").findUnfinishedParts(); };
  EXPECT_THAT(findUnfinished(), ElementsAre("block_0_0 has not been trained", "background has not been trained"));
  options.loop.resume = true;
  options.only = {"block_0_0"};
  int asked = 0;
  const int looks = 2 * static_cast<int>(scene.capture().photosIn(Split::train).size());  // for surfaces
  options.loop.stopRequested = [&] { return ++asked > looks + 6; };
  EXPECT_FALSE(train("mesh", options).finished);
  EXPECT_THAT(findUnfinished(),
              ElementsAre("block_0_0 has been trained for 6 of 20 steps", "background has not been trained"));

  options.loop.stopRequested = [] { return false; };
  options.only = {};
  EXPECT_TRUE(train("mesh", options).finished);
  EXPECT_THAT(findUnfinished(), ElementsAre());
  const auto whole = lastCheckpoints(scene / "mesh");
  fs::remove_all(scene / "mesh" / "parts" / "block_1_0");
  EXPECT_THAT(findUnfinished(), ElementsAre("block_1_0 has not been trained"));
  EXPECT_TRUE(train("mesh", options).finished);
  EXPECT_EQ(lastCheckpoints(scene / "mesh"), whole) << "a lost block is trained again";
  fs::remove_all(scene / "mesh" / "parts" / "block_1_0");
  writeShownParts(scene / "mesh", {{"block_0_0", 0, {}, {1, 1, 1}}});
  EXPECT_THAT(findUnfinished(), ElementsAre()) << "photos show nothing of the others";
  for (const char* const text : {"", "{}", R"({"parts": "block_0_0"})", R"({"parts": [1]})"}) {
    writeFileAtomically(scene / "mesh" / "shown.json", text);
    EXPECT_THROW(findUnfinished(), Error) << text;
  }
}

// The stages that look through the photos take minutes with large captures.
TEST_F(TrainMesh, StopsWhileItLooksThroughThePhotos) {
  TrainMeshOptions options = smallOptions();
  options.only = {"coarse"};
  options.config.transient = "auto";
  EXPECT_TRUE(train("mesh", options).finished);
  fs::remove_all(scene / "mesh" / "transient");
  options.only = {};
  options.loop.resume = true;
  const int photos = static_cast<int>(scene.capture().photosIn(Split::train).size());
  for (const int looks : {1, photos + 1}) {  // for what moves; for surfaces
    int asked = 0;
    options.loop.stopRequested = [&] { return ++asked >= looks; };
    EXPECT_FALSE(train("mesh", options).finished);
    EXPECT_EQ(asked, looks) << "it stops at the photo at which it is asked to";
    EXPECT_EQ(fs::exists(scene / "mesh" / "transient" / "masks.json"), looks > photos);
    EXPECT_FALSE(fs::exists(scene / "mesh" / "parts" / "block_0_0" / "manifest.json"));
  }
}

// Whoever watches a training looks at the folder's manifest alone.
TEST_F(TrainMesh, SumsUpItsPartsAtEachCheckpoint) {
  TrainMeshOptions options = smallOptions();
  options.loop.checkpointSeconds = 0;
  std::set<int64_t> steps;
  options.loop.stopRequested = [&] {
    steps.insert(requireManifest(ModelFolder(scene / "mesh")).step);
    return false;
  };
  EXPECT_TRUE(train("mesh", options).finished);
  EXPECT_GT(steps.size(), size_t{2} * kSteps);
  const ModelManifest manifest = requireManifest(ModelFolder(scene / "mesh"));
  EXPECT_EQ(manifest.step, manifest.plannedSteps);
}

// Photos are drawn in another order if they do not fit the memory.
TEST_F(TrainMesh, KeepsThePhotoBudgetOfViewsBetweenPhotos) {
  const CubeScene few({.isEnclosed = true, .photos = 16});
  TrainMeshOptions options = smallOptions();
  options.config.enoughPhotos = 40;
  options.config.coarseSteps = 120;
  options.only = {"coarse"};
  const double photos = static_cast<double>(decodedBytes(few.capture(), few.capture().photosIn(Split::train)));
  options.memoryMiB = photos / (1 << 20);
  options.memoryMiB *= 1.01 * photos / options.bytesForPhotos();
  EXPECT_TRUE(trainMesh(*device, few.capture(), few / "mesh", options).finished);
  ASSERT_TRUE(fs::exists(few / "mesh" / "views"));
  EXPECT_NEAR(savedConfig<MeshConfig>(few / "mesh").photoBudgetMiB, 1.01 * photos / (1 << 20), 0.01);
}

TEST_F(TrainMesh, StatesTheCommandThatRepeatsIt) {
  TrainMeshOptions options = smallOptions();
  options.only = {"coarse"};
  EXPECT_TRUE(train("steps", options).finished);
  EXPECT_THAT(readTextFile(scene / "steps" / "config.toml"), testing::HasSubstr("THIS_FILE --steps 20\n"));
  options.loop.minutes = 0.01;
  EXPECT_TRUE(train("minutes", options).finished);
  EXPECT_THAT(readTextFile(scene / "minutes" / "config.toml"), testing::HasSubstr("THIS_FILE --minutes 0.01\n"));
}

TEST_F(TrainMesh, KeepsThePlanOfAPartThatHasNoCheckpointYet) {
  TrainMeshOptions options = smallOptions();
  options.only = {"coarse"};
  EXPECT_TRUE(train("mesh", options).finished);
  const fs::path folder = scene / "mesh" / "parts" / "block_0_0";
  fs::create_directories(folder);
  ModelFolder(folder).writePlan({7, 3});
  options.only = {"block_0_0"};
  options.loop.resume = true;
  options.loop.steps = 0;
  options.loop.minutes = 0.05;
  EXPECT_TRUE(train("mesh", options).finished);
  EXPECT_EQ(requireManifest(ModelFolder(folder)).step, 7);
}

TEST_F(TrainMesh, RecordsHowWellBlocksCoverWhatPhotosShow) {
  TrainMeshOptions options = smallOptions();
  options.only = {"coarse", "background", "block_1_0"};
  EXPECT_TRUE(train("mesh", options).finished);
  const std::vector<SurfaceCoverage> coverage = readMeshCoverage(scene / "mesh");
  ASSERT_EQ(coverage.size(), 1u) << "what is outside of the blocks is not checked";
  EXPECT_EQ(coverage[0].part, "block_1_0");
  EXPECT_GT(coverage[0].pixels, 0u);
  EXPECT_LE(coverage[0].holes, coverage[0].pixels);
  const TrainedMesh mesh = loadTrainedMesh(*device, scene / "mesh");
  EXPECT_EQ(mesh.parts.front()->atlas()->coverage, coverage[0]);

  options.config.finalShare = 0;
  EXPECT_TRUE(train("without", options).finished);
  EXPECT_TRUE(readMeshCoverage(scene / "without").empty()) << "its faces are extracted when it is baked";
  EXPECT_THROW(readMeshCoverage(scene / "nothing"), Error);
}

TEST_F(TrainMesh, IsLoadedAsFarAsItIsUsed) {
  EXPECT_TRUE(train("mesh", smallOptions()).finished);
  const StoredMesh stored(*device, scene / "mesh");
  ASSERT_EQ(stored.parts().size(), 3u);
  EXPECT_TRUE(stored.parts().back().part.isBackground());
  const StoredMesh::Part& block = stored.parts().front();
  EXPECT_GT(block.levels, 1u);
  EXPECT_TRUE(block.hasAtlas);
  const auto training = stored.load(block.part, MeshUse::training), baking = stored.load(block.part, MeshUse::baking),
             rendering = stored.load(block.part, MeshUse::rendering);
  const auto texels = [&](MeshModel& model) { return device->read(model.coarseAtlas(1)->texels.values.all()); };
  EXPECT_GT(training->field().table().gradients.size(), 0u);
  EXPECT_EQ(baking->field().table().gradients.size(), 0u);
  EXPECT_EQ(baking->level(0).displacements().firstMoments.size(), 0u);
  EXPECT_EQ(baking->coarseAtlas(1)->texels.secondMoments.size(), 0u);
  EXPECT_EQ(baking->levels(), block.levels);
  EXPECT_EQ(texels(*baking), texels(*training));
  EXPECT_EQ(rendering->levels(), 1u);
  for (MeshModel* const model : {baking.get(), rendering.get()}) {
    EXPECT_EQ(device->read(model->field().table().values.all()), device->read(training->field().table().values.all()));
    EXPECT_EQ(model->level(0).tracedCells(), training->level(0).tracedCells());
  }
}

TEST_F(TrainMesh, RefusesPartsThatDoNotExist) {
  TrainMeshOptions options = smallOptions();
  options.only = {"block_2_0"};
  try {
    train("none", options);
    FAIL();
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("coarse, block_0_0, block_1_0, background"), std::string::npos)
        << error.what();
  }
  EXPECT_FALSE(fs::exists(scene / "none" / "config.toml"));
}

TEST_F(TrainMesh, WithoutABackgroundBlockTrainsBlocksAlone) {
  TrainMeshOptions options = smallOptions();
  options.config.backgroundBlock = "none";
  EXPECT_TRUE(train("mesh", options).finished);
  EXPECT_EQ(lastCheckpoints(scene / "mesh").count("background"), 0u);
  TrainedMesh mesh = loadTrainedMesh(*device, scene / "mesh");
  ASSERT_EQ(mesh.parts.size(), 2u);
  // A ray that misses the region sees nothing.
  MeshRenderer renderer(mesh);
  EXPECT_FALSE(renderer.showsOutside());
  Pose away = scene.capture().photos[0].worldFromCamera;
  away.rotation = away.rotation * Eigen::AngleAxisd(3.14159, Vec3d::UnitY()).toRotationMatrix();
  const RenderedView view = renderer.render(scene.capture().cameras[0].scaledTo(8, 6), away, nullptr);
  for (const float opacity : view.opacity.pixels) EXPECT_LT(opacity, 0.5f);
}

}  // namespace
}  // namespace tessera
