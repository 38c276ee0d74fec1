#include "representations/volume/bake_volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "render/cpu/volume_renderer.h"
#include "render/volume_scene.h"
#include "representations/volume/train_volume.h"
#include "representations/volume/volume_cube.h"
#include "representations/volume/volume_model_renderer.h"
#include "tiles/scene_folder.h"
#include "tiles/volume_payload.h"
#include "train/test_support.h"

namespace tessera {
namespace {

std::unique_ptr<VolumeRenderer> openScene(const fs::path& folder) {
  VolumeScene scene = openVolumeScene(folder);
  VolumeRendererSettings settings;
  settings.selection.mostPixels = 0;
  settings.threads = 2;
  return std::make_unique<VolumeRenderer>(scene.frame, std::move(scene.tree), std::move(scene.source), settings);
}

// A copy, as baking owns the models that it bakes.
LevelModels onlyLevel(TrainedVolumeCube& trained) {
  return [&](uint32_t) {
    VolumeModel& from = trained.model();
    auto made = std::make_unique<VolumeModel>(from.device(), from.config(), from.grid());
    made->copyFields(from);
    made->device().write(made->deferred().values.all(),
                         std::span<const float>(from.device().read(from.deferred().values.all())));
    return made;
  };
}

// What docs/tile-format.md says a sample's eight sums are, from the bytes of a part.
std::array<double, 8> sumsFromBytes(const VolumeContent& content, const VolumePart& part, const float p[3]) {
  const auto value = [&](uint8_t byte, size_t attribute) {
    const double range = attribute == 0 ? content.densityRange : content.featureRange;
    return range * (2 * byte / 255.0 - 1);
  };
  struct Pair {
    uint32_t low, high;
    double share;
  };
  const auto pairAt = [](double position, uint32_t resolution) {
    const double u = position * resolution - 0.5, low = std::floor(u), last = resolution - 1.0;
    return Pair{static_cast<uint32_t>(std::clamp(low, 0.0, last)),
                static_cast<uint32_t>(std::clamp(low + 1, 0.0, last)), u - low};
  };
  std::array<double, 8> sums{};
  const uint32_t blocks = part.voxels / 8;
  Pair v[3];
  uint32_t b[3], inBlock[3];
  double share[3];
  for (int a = 0; a < 3; ++a) {
    v[a] = pairAt(p[a], part.voxels);
    // Clamped first, then the macroblock; the apron holds the upper neighbour.
    const double u = std::clamp(static_cast<double>(p[a]) * part.voxels - 0.5, 0.0, part.voxels - 1.0);
    b[a] = static_cast<uint32_t>(u) / 8;
    inBlock[a] = static_cast<uint32_t>(u) % 8;
    share[a] = u - std::floor(u);
  }
  const uint32_t stored = part.macroblocks[b[0] + blocks * (b[1] + blocks * b[2])];
  EXPECT_NE(stored, VolumePart::kEmpty);
  for (int c = 0; c < 8; ++c) {
    const uint32_t upper[3] = {c & 1u, c >> 1 & 1u, static_cast<uint32_t>(c >> 2)};
    double weight = 1;
    for (int a = 0; a < 3; ++a) weight *= upper[a] ? share[a] : 1 - share[a];
    const size_t texel = inBlock[0] + upper[0] + 9 * (inBlock[1] + upper[1] + 9 * (inBlock[2] + upper[2]));
    for (size_t f = 0; f < 8; ++f) {
      sums[f] += weight * value(part.voxelBytes[(stored * size_t{729} + texel) * 8 + f], f);
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    const Pair along = pairAt(p[axis == 0 ? 1 : 0], part.planes), across = pairAt(p[axis == 2 ? 1 : 2], part.planes);
    for (int k = 0; k < 4; ++k) {
      const uint32_t column = k & 1 ? along.high : along.low, row = k >> 1 ? across.high : across.low;
      const double weight = (k & 1 ? along.share : 1 - along.share) * (k >> 1 ? across.share : 1 - across.share);
      for (size_t f = 0; f < 8; ++f) {
        sums[f] += weight * value(part.planeBytes[axis][(size_t{row} * part.planes + column) * 8 + f], f);
      }
    }
  }
  return sums;
}

// Invariant 6 of the specification: what training sees is what is read from tiles, at borders too.
TEST(BakeVolume, StoresTheVeryNumbersThatTrainingSaw) {
  const CubeScene scene;
  TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(2), 60);
  VolumeModel& model = trained.model();
  Device& device = model.device();
  const VirtualGrid& grid = model.virtualGrid();
  const uint32_t kSamples = 300, block = 1;
  const RandomStream random(5, 0xba4e);
  std::vector<float> positions;
  AliveTexels alive(grid);
  for (uint32_t s = 0; s < kSamples; ++s) {
    for (uint32_t a = 0; a < 3; ++a) {
      float p = random.uniform(4 * s + a);
      if (random.below(4 * s + 3, 8) == a) p = s % 2 ? 0.0f : 1.0f;
      positions.push_back(p);
    }
    alive.mark(&positions[size_t{3} * s]);
  }
  std::vector<AliveTexels> ofBlocks(2, AliveTexels(grid));
  ofBlocks[block] = alive;
  const VolumeContent content = bakeGroup(model, block, ofBlocks);

  const Array<uint32_t> blocks = device.arrayOf(std::vector<uint32_t>(kSamples, block));
  const Array<float> at = device.arrayOf(positions);
  const uint32_t room = kSamples * VirtualGrid::kCorners;
  Array<uint32_t> marks = device.array<uint32_t>(2 * grid.words()), ranks = device.array<uint32_t>(2 * grid.words());
  Array<uint32_t> firstTexel = device.array<uint32_t>(3);
  Array<float> texelPositions = device.array<float>(3 * room), logDensities = device.array<float>(kSamples);
  Array<float> colours = device.array<float>(7 * kSamples);
  DistinctTexels distinct{grid};
  distinct.blocks = 2;
  distinct.samples = {kSamples};
  distinct.blockOfSample = blocks;
  distinct.positions = at;
  distinct.texelCapacity = room;
  distinct.marks = marks;
  distinct.ranks = ranks;
  distinct.firstTexel = firstTexel;
  distinct.texelPositions = texelPositions;
  device.run(distinct);
  BlockFieldBatch batch(device, model.attributes().shape(), room, false);
  batch.firstOfSlot = firstTexel;
  batch.positions = texelPositions;
  model.attributes().forward(batch, false);
  VirtualGridForward forward{grid};
  forward.samples = {kSamples};
  forward.blockOfSample = blocks;
  forward.positions = at;
  forward.marks = marks;
  forward.ranks = ranks;
  forward.texels = {room, firstTexel.part(2, 1)};
  forward.attributes = batch.outputs;
  forward.logDensities = logDensities;
  forward.colours = colours;
  device.run(forward);
  const std::vector<float> trainedDensity = device.read(logDensities.all()),
                           trainedColours = device.read(colours.all());
  for (uint32_t s = 0; s < kSamples; ++s) {
    const std::array<double, 8> sums = sumsFromBytes(content, content.parts[0], &positions[size_t{3} * s]);
    EXPECT_NEAR(trainedDensity[s], std::min(sums[0] - 1, 15.0), 2e-5);
    for (size_t f = 1; f < 8; ++f) EXPECT_NEAR(trainedColours[7 * s + f - 1], 1 / (1 + std::exp(-sums[f])), 1e-5);
  }
}

TEST(BakeVolume, LooksAsTheModelThatItWasBakedFrom) {
  const CubeScene scene;
  const TestFolder folder;
  for (const char* surround : {"none", "own"}) {
    VolumeConfig config = smallVolumeConfig();
    config.surround = surround;
    TrainedVolumeCube trained(scene, config, cubeGrid(2), 300);
    const BakedVolume baked = bakeVolume(onlyLevel(trained), 1, scene.capture(), folder / surround, {});
    EXPECT_EQ(baked.tileset.tiles.size(), 3u);
    VolumeModelRenderer model(trained.model(), static_cast<float>(config.cullLast));
    const std::unique_ptr<VolumeRenderer> tiles = openScene(folder / surround);
    double ofModel = 0, ofTiles = 0;
    const std::vector<int> photos = scene.capture().photosIn(Split::test);
    for (const int photo : photos) {
      const Camera& camera = scene.capture().cameras[0];
      const Pose& pose = scene.capture().photos[photo].worldFromCamera;
      const RenderedView truth = scene.truth(camera, pose);
      ofModel += psnrOf(model.render(camera, pose, nullptr), truth);
      ofTiles += psnrOf(tiles->render(camera, pose, nullptr), truth);
    }
    EXPECT_NEAR(ofTiles / static_cast<double>(photos.size()), ofModel / static_cast<double>(photos.size()), 0.5)
        << surround;
  }
}

TEST(BakeVolume, PutsLevelsAboveOneAnother) {
  const CubeScene scene;
  const TestFolder folder;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  TrainVolumeOptions options;
  options.config = smallVolumeConfig();
  options.blocks = *parseBlockCount("2x2");
  options.loop.steps = 30;
  options.loop.progress = false;
  trainVolume(*device, scene.capture(), folder / "model", options);
  ASSERT_EQ(trainedLevels(folder / "model"), 2u);
  const BakedVolume baked =
      bakeVolume([&](uint32_t level) { return loadVolumeModel(*device, levelFolder(folder / "model", level)); }, 2,
                 scene.capture(), folder / "scene", {});
  ASSERT_EQ(baked.tileset.tiles.size(), 5u);
  const Tile& root = baked.tileset.tiles[0];
  EXPECT_EQ(root.children.size(), 4u);
  EXPECT_EQ(root.level, 1u);
  EXPECT_NEAR(root.geometricError, 2 * baked.tileset.tiles[1].geometricError, 1e-9);
  const VolumeContent merged = readVolume(contentPath(folder / "scene", root.contents.at(0).uri));
  EXPECT_EQ(merged.parts.size(), 4u) << "side by side, each with its own texels";
  EXPECT_EQ(merged.parts[0].planes, 32u);
  // Drawn at either level.
  for (const int finest : {0, 1}) {
    VolumeScene opened = openVolumeScene(folder / "scene");
    VolumeRendererSettings settings;
    settings.selection.mostPixels = 0;
    settings.selection.finestLevel = finest;
    VolumeRenderer renderer(opened.frame, std::move(opened.tree), std::move(opened.source), settings);
    const RenderedView view =
        renderer.render(scene.capture().cameras[0], scene.capture().photos[0].worldFromCamera, nullptr);
    EXPECT_EQ(renderer.selection().cut.size(), finest == 0 ? 4u : 1u);
    for (const float value : view.colour.pixels) ASSERT_TRUE(std::isfinite(value));
  }
}

TEST(BakeVolume, WritesTheSameSceneAgain) {
  const CubeScene scene;
  const TestFolder folder;
  TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(), 60);
  const BakedVolume once = bakeVolume(onlyLevel(trained), 1, scene.capture(), folder / "scene", {});
  const std::string text = readTextFile(folder / "scene/tileset.json");
  const BakedVolume again = bakeVolume(onlyLevel(trained), 1, scene.capture(), folder / "scene", {});
  EXPECT_EQ(readTextFile(folder / "scene/tileset.json"), text);
  EXPECT_EQ(once.levels.at(0).bytesOnDisk, again.levels.at(0).bytesOnDisk);
  EXPECT_EQ(readTileset(folder / "scene").tiles.size(), 1u) << "one block is its own root";
}

TEST(BakeVolume, KeepsNothingOfAModelThatHasSeenNothing) {
  const CubeScene scene;
  TrainedVolumeCube untrained(scene, smallVolumeConfig(), cubeGrid(), 0);
  const VolumeContent content = bakeGroup(untrained.model(), 0, {AliveTexels(untrained.model().virtualGrid())});
  EXPECT_EQ(content.parts[0].storedMacroblocks(), 0u);
  EXPECT_FALSE(brokenRule(content));
  for (const uint8_t distance : content.parts[0].distances) EXPECT_EQ(distance, 255);
}

}  // namespace
}  // namespace tessera
