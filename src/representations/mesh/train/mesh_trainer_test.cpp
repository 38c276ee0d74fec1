#include "representations/mesh/train/mesh_trainer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>

#include "representations/mesh/testing/cube_training.h"
#include "representations/mesh/train/extraction.h"

namespace tessera {
namespace {

TEST(MeshTrainer, LearnsWhatHeldOutPhotosSee) {
  const CubeScene scene;
  CubeTraining trained(scene, smallMeshConfig(), 400);
  EXPECT_GT(heldOutPsnr(scene, trained.trainer->model()), 17);
}

// Returns the networks, the table and the exposures of a checkpoint, and the finest level.
std::map<std::string, Bytes> finestTensors(const Bytes& checkpoint) {
  const auto file = decodeSafetensors(checkpoint);
  std::map<std::string, Bytes> tensors;
  for (const auto& [name, tensor] : file->tensors)
    if (!name.starts_with("level") || name.starts_with("level0."))
      tensors[name] = Bytes(tensor.bytes.begin(), tensor.bytes.end());
  return tensors;
}

TEST(MeshTrainer, TrainsCoarseLevelsThatChangeNothingElse) {
  const CubeScene scene;
  MeshConfig config = smallMeshConfig(), alone = config;
  config.meshCells = alone.meshCells = 32;
  config.meshLevels = 3;
  config.fittedLevels = false;
  alone.meshLevels = 1;
  constexpr int64_t kSteps = 400;
  CubeTraining trained(scene, config, kSteps), single(scene, alone, kSteps);
  EXPECT_EQ(finestTensors(trained.trainer->save(0)), finestTensors(single.trainer->save(0)));
  MeshModel& model = trained.trainer->model();
  ASSERT_EQ(model.levels(), 3u);
  for (uint32_t number = 0; number < 3; ++number) {
    MeshLevel& level = model.level(number);
    EXPECT_EQ(level.domain().grids.at(0).resolution, 32u >> number);
    double largest = 0;
    for (const float d : trained.device->read(level.displacements().values.all()))
      largest = std::max(largest, std::abs(double{d}));
    EXPECT_GT(largest, 0.1) << number;
    EXPECT_LE(largest, 0.5) << number;
    EXPECT_GT(heldOutPsnr(scene, model, number), 15) << number;
  }
}

TEST(MeshTrainer, StatesHowWellTheBlockCoversWhatPhotosShowInTheEnd) {
  const CubeScene scene;
  constexpr int64_t kSteps = 160;
  CubeTraining trained(scene, smallMeshConfig(), 0, 2, startAtCube);
  MeshModel& model = trained.trainer->model();
  const std::vector<TileShares> tiles = startAtCube(scene, model.level(0).domain()).tiles;
  SurfaceCoverage first;
  for (int64_t step = 0; step < kSteps; ++step) {
    trained.trainer->step(step, kSteps);
    if (model.atlas() && first.pixels == 0) first = model.atlas()->coverage;
  }
  const SurfaceCoverage last = model.atlas()->coverage;
  EXPECT_EQ(last.part, "block_0_0");
  EXPECT_EQ(last, checkCoverage(model, scene.capture(), tiles));
  EXPECT_EQ(last.pixels, first.pixels);
  EXPECT_NE(last.holes, first.holes) << "the final stage changes opacities";
}

TEST(MeshTrainer, MovesVerticesToTheSurfaceWithinTheirCells) {
  const CubeScene scene;
  MeshConfig moving = smallMeshConfig();
  moving.finalShare = 0;
  MeshConfig still = moving;
  still.vertexLearningRate = 0;
  CubeTraining moved(scene, moving, 400), unmoved(scene, still, 400);
  EXPECT_GT(heldOutPsnr(scene, moved.trainer->model()), heldOutPsnr(scene, unmoved.trainer->model()));
  double largest = 0;
  for (const float d : moved.device->read(moved.trainer->model().level(0).displacements().values.all()))
    largest = std::max(largest, std::abs(double{d}));
  EXPECT_GT(largest, 0.1);
  EXPECT_LE(largest, 0.5);
  for (const float d : unmoved.device->read(unmoved.trainer->model().level(0).displacements().values.all()))
    ASSERT_EQ(d, 0);
}

TEST(MeshTrainer, EmptiesOnlyCellsThatDoNotMatter) {
  const CubeScene scene;
  MeshConfig config = smallMeshConfig();
  config.finalShare = 0;
  CubeTraining trained(scene, config, 400);
  MeshLevel& level = trained.trainer->model().level(0);
  const Photo& photo = scene.capture().photos[scene.capture().photosIn(Split::test)[1]];
  const auto render = [&] {
    return MeshPartRenderer(trained.trainer->model())
        .render(scene.capture().cameras[photo.camera], photo.worldFromCamera, nullptr);
  };
  const auto countTraced = [&] {
    size_t count = 0;
    for (const uint32_t word : level.tracedCells()) count += static_cast<size_t>(std::popcount(word));
    return count;
  };
  const RenderedView with = render();
  const size_t cells = level.domain().grids[0].cells(), traced = countTraced();
  EXPECT_LT(traced, cells * 3 / 4);
  level.occupancy().restore(level.occupancy().values(), std::vector<uint32_t>(cells / 32, ~0u));
  level.exclude(std::vector<bool>(cells, true));  // excludes none, and traces those that are occupied
  ASSERT_EQ(countTraced(), cells);
  const RenderedView without = render();
  double sum = 0;
  for (size_t i = 0; i < with.colour.pixels.size(); ++i)
    sum += std::abs(with.colour.pixels[i] - without.colour.pixels[i]);
  EXPECT_GT(sum, 0) << "the empty cells are traced";
  EXPECT_LT(sum / static_cast<double>(with.colour.pixels.size()), 4e-3) << "fog";
}

// Returns the number of cells of the finest level that rays of a new training are traced through after some steps.
size_t countFirstCells(const CubeScene& scene, bool coarseCells, int64_t steps = 0) {
  MeshConfig config = smallMeshConfig();
  config.coarseCells = coarseCells;
  config.finalShare = 0;
  config.occupancyStartSteps = config.occupancyEvery = 1;
  const CubeTraining begun(scene, config, steps, 2, [](const CubeScene& cube, const OctahedraDomain& domain) {
    MeshStart start = startEverywhere(cube, domain);
    std::fill(start.cells.begin() + 16 * 6, start.cells.end(), false);  // six rows of the lowest layer
    return start;
  });
  size_t cells = 0;
  for (const uint32_t word : begun.trainer->model().level(0).tracedCells())
    cells += static_cast<size_t>(std::popcount(word));
  return cells;
}

TEST(MeshTrainer, StartsWithTheCellsOfTheCoarseFieldOrAsInThePaperWithAll) {
  const CubeScene scene;
  EXPECT_EQ(countFirstCells(scene, true), size_t{16} * 7 * 2) << "with the cells around them";
  EXPECT_EQ(countFirstCells(scene, false), size_t{16} * 16 * 16);
  EXPECT_EQ(countFirstCells(scene, false, 5), size_t{16} * 16 * 16) << "four updates are too few to empty a cell";
}

// Returns the mean opacity of the pixels of held-out photos that show nothing.
double opacityBesideCube(const CubeScene& scene, MeshModel& model) {
  MeshPartRenderer renderer(model, 0);
  double sum = 0;
  int pixels = 0;
  for (const int index : scene.capture().photosIn(Split::test)) {
    const Photo& photo = scene.capture().photos[index];
    const Camera& camera = scene.capture().cameras[photo.camera];
    const RenderedView view = renderer.render(camera, photo.worldFromCamera, nullptr),
                       truth = scene.truth(camera, photo.worldFromCamera);
    for (size_t pixel = 0; pixel < truth.opacity.pixels.size(); ++pixel) {
      if (truth.opacity.pixels[pixel] > 0) continue;
      sum += view.opacity.pixels[pixel];
      ++pixels;
    }
  }
  return sum / pixels;
}

TEST(MeshTrainer, EmptiesTheSpaceThatRaysThroughTheBlockCross) {
  const CubeScene scene;
  MeshConfig with = smallMeshConfig();
  with.opacityOffset = -2;             // fog at the start
  with.occupancyStartSteps = 1 << 20;  // which remains where no ray comes
  with.finalShare = 0;
  with.throughShare = 0.25;
  MeshConfig without = with;
  without.throughShare = 0;
  constexpr int64_t kSteps = 150;
  CubeTraining cleared(scene, with, kSteps, 2, startAtCube), foggy(scene, without, kSteps, 2, startAtCube);
  const double left = opacityBesideCube(scene, cleared.trainer->model()),
               fog = opacityBesideCube(scene, foggy.trainer->model());
  EXPECT_GT(fog, 0.4);
  EXPECT_LT(left, 0.2 * fog);
  EXPECT_LT(cleared.last.rays, foggy.last.rays) << "their hits count as those of other rays";
}

TEST(MeshTrainer, MakesTheSameBytesOnAnyNumberOfThreads) {
  const CubeScene scene;
  for (const MakeStart start : {startEverywhere, startAtCube}) {
    const auto train = [&](int threads) {
      return CubeTraining(scene, smallMeshConfig(), 90, threads, start).trainer->save(0);
    };
    const Bytes one = train(1);
    EXPECT_EQ(one, train(2));
    EXPECT_EQ(one, train(5));
  }
}

TEST(MeshTrainer, GoesOnAfterRestoringAsIfNothingHadHappened) {
  const CubeScene scene;
  constexpr int64_t kSteps = 90;
  for (const MakeStart start : {startEverywhere, startAtCube}) {
    CubeTraining unbroken(scene, smallMeshConfig(), kSteps, 2, start);
    Bytes state;
    int64_t step = 0;
    for (const int64_t until : {0, 1, 15, 17, 64, 65, 72, 90}) {
      CubeTraining part(scene, smallMeshConfig(), 0, 2, start);
      if (!state.empty()) {
        const auto file = decodeSafetensors(state);
        ASSERT_TRUE(file);
        part.trainer->restore(0, "state", *file);
      }
      for (; step < until; ++step) part.trainer->step(step, kSteps);
      state = part.trainer->save(0);
    }
    EXPECT_EQ(state, unbroken.trainer->save(0));
    EXPECT_NE(unbroken.trainer->model().coarseAtlas(1), nullptr) << "levels were fitted and stored, too";
  }
}

}  // namespace
}  // namespace tessera
