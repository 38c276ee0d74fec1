#include "representations/volume/bake/bake_volume.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "render/tile_scene.h"
#include "representations/volume/content/volume_payload.h"
#include "representations/volume/testing/volume_cube.h"
#include "representations/volume/testing/volume_renderer.h"
#include "representations/volume/train/train_volume.h"
#include "representations/volume/train/volume_model_renderer.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"
#include "train/level_folders.h"
#include "train/testing/test_support.h"
#ifdef TESSERA_HAS_VULKAN
#include "gpu/testing/test_context.h"
#endif

namespace tessera {
namespace {

std::unique_ptr<VolumeRenderer> openScene(const fs::path& folder) {
  TileScene scene = openTileScene(folder, volumeCodec());
  SceneRendererSettings settings;
  settings.selection.maximumScreenSpaceError = 0;
  settings.threads = 2;
  return std::make_unique<VolumeRenderer>(scene.frame, std::move(scene.tree), std::move(scene.source), settings);
}

// Returns copies, because baking takes ownership of the models that it bakes.
LevelModels onlyLevel(TrainedVolumeCube& trained) {
  return [&](uint32_t) {
    VolumeModel& from = trained.model();
    auto copy = std::make_unique<VolumeModel>(from.device(), from.config(), from.grid());
    copy->copyFields(from);
    copy->device().write(copy->deferred().values.all(),
                         std::span<const float>(from.device().read(from.deferred().values.all())));
    return copy;
  };
}

// Computes the eight sums of a sample from the bytes of a part, as docs/tile-format.md defines them.
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
    // The position is clamped before the macroblock is chosen; the apron stores the upper neighbour.
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

// Invariant 6 of docs/invariants.md: tiles store exactly the values that training used, at borders too.
TEST(BakeVolume, StoresExactlyTheValuesThatTrainingUsed) {
  const CubeScene scene;
  TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(2), 60);
  VolumeModel& model = trained.model();
  Device& device = model.device();
  const VirtualGrid& grid = model.virtualGrid();
  const uint32_t kSamples = 300, block = 1;
  const RandomStream random(5, 0xba4e);
  std::vector<float> positions;
  OccupiedTexels occupied(grid);
  for (uint32_t s = 0; s < kSamples; ++s) {
    for (uint32_t a = 0; a < 3; ++a) {
      float p = random.uniform(4 * s + a);
      if (random.below(4 * s + 3, 8) == a) p = s % 2 ? 0.0f : 1.0f;
      positions.push_back(p);
    }
    occupied.mark(&positions[size_t{3} * s]);
  }
  std::vector<OccupiedTexels> ofBlocks(2, OccupiedTexels(grid));
  ofBlocks[block] = occupied;
  const VolumeContent content = bakeGroup(model, block, ofBlocks);

  const Array<uint32_t> blocks = device.uploadArray(std::vector<uint32_t>(kSamples, block));
  const Array<float> at = device.uploadArray(positions);
  const uint32_t capacity = kSamples * VirtualGrid::kCorners;
  Array<uint32_t> marks = device.array<uint32_t>(2 * grid.words()), ranks = device.array<uint32_t>(2 * grid.words());
  Array<uint32_t> firstTexel = device.array<uint32_t>(3);
  Array<float> texelPositions = device.array<float>(3 * capacity), logDensities = device.array<float>(kSamples);
  Array<float> colours = device.array<float>(7 * kSamples);
  DistinctTexels distinct{grid};
  distinct.blocks = 2;
  distinct.samples = {kSamples};
  distinct.blockOfSample = blocks;
  distinct.positions = at;
  distinct.texelCapacity = capacity;
  distinct.marks = marks;
  distinct.ranks = ranks;
  distinct.firstTexel = firstTexel;
  distinct.texelPositions = texelPositions;
  device.run(distinct);
  BlockFieldBatch batch(device, model.attributes().shape(), capacity, false);
  batch.firstOfSlot = firstTexel;
  batch.positions = texelPositions;
  model.attributes().forward(batch, false);
  VirtualGridForward forward{grid};
  forward.samples = {kSamples};
  forward.blockOfSample = blocks;
  forward.positions = at;
  forward.marks = marks;
  forward.ranks = ranks;
  forward.texels = {capacity, firstTexel.part(2, 1)};
  forward.attributes = batch.outputs;
  forward.logDensities = logDensities;
  forward.colours = colours;
  device.run(forward);
  // The same attributes interpolated in double precision: the remaining differences are rounding of floats.
  const std::unique_ptr<Device> reference = makeDevice({"reference", 1});
  const auto onReference = [&](const auto& array) { return reference->uploadArray(device.read(array.all())); };
  const Array<uint32_t> exactBlocks = onReference(blocks), exactMarks = onReference(marks);
  const Array<uint32_t> exactRanks = onReference(ranks);
  const Array<float> exactAt = onReference(at), exactAttributes = onReference(batch.outputs);
  Array<float> exactDensities = reference->array<float>(kSamples), exactColours = reference->array<float>(7 * kSamples);
  VirtualGridForward exact{grid};
  exact.samples = {kSamples};
  exact.blockOfSample = exactBlocks;
  exact.positions = exactAt;
  exact.marks = exactMarks;
  exact.ranks = exactRanks;
  exact.texels = {capacity};
  exact.attributes = exactAttributes;
  exact.logDensities = exactDensities;
  exact.colours = exactColours;
  reference->run(exact);
  const auto expectStored = [&](const std::vector<float>& density, const std::vector<float>& colour, double tolerance) {
    for (uint32_t s = 0; s < kSamples; ++s) {
      const std::array<double, 8> sums = sumsFromBytes(content, content.parts[0], &positions[size_t{3} * s]);
      const double expected = std::min(sums[0] - 1, 15.0);
      EXPECT_NEAR(density[s], expected, tolerance * std::max(1.0, std::abs(expected)));
      for (size_t f = 1; f < 8; ++f) EXPECT_NEAR(colour[7 * s + f - 1], 1 / (1 + std::exp(-sums[f])), tolerance);
    }
  };
  // Positions among 32 voxels are floats, with half a unit in the last place of 1e-6 of a voxel; the densities of two
  // neighbouring voxels differ by up to 28.
  expectStored(device.read(logDensities.all()), device.read(colours.all()), 3e-5);
  expectStored(reference->read(exactDensities.all()), reference->read(exactColours.all()), 1e-6);
}

// The apron: a sample between the last voxel of a macroblock and the first of the next needs no other macroblock.
TEST(BakeVolume, RepeatsTheFirstTexelsOfTheNextMacroblock) {
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  VolumeModel model(*device, smallVolumeConfig(), cubeGrid());
  const RandomStream random(6, 0xba4e);
  std::vector<float> table(model.attributes().table(0).values.size());
  for (size_t i = 0; i < table.size(); ++i) table[i] = 2 * random.uniform(1000 + i) - 1;
  device->write(model.attributes().table(0).values.all(), std::span<const float>(table));
  OccupiedTexels occupied(model.virtualGrid());
  for (uint64_t i = 0; i < 40; ++i) {
    const float at[3] = {random.uniform(3 * i), random.uniform(3 * i + 1), random.uniform(3 * i + 2)};
    occupied.mark(at);
  }
  const VolumePart part = bakePart(model, 0, occupied);
  const uint32_t blocks = part.voxels / 8;
  const uint8_t* bytes = part.voxelBytes.data();
  const auto texel = [&](uint32_t stored, const std::array<uint32_t, 3>& at) {
    return bytes + (stored * size_t{729} + at[0] + 9 * (at[1] + 9 * at[2])) * 8;
  };
  int pairs = 0, alike = 0, last = 0;
  for (uint32_t b = 0; b < part.macroblocks.size(); ++b) {
    if (part.macroblocks[b] == VolumePart::kEmpty) continue;
    for (size_t axis = 0; axis < 3; ++axis) {
      const uint32_t stride = axis == 0 ? 1 : axis == 1 ? blocks : blocks * blocks;
      const bool isLast = b / stride % blocks == blocks - 1;
      const uint32_t next = isLast ? b : b + stride;  // at the end of the grid, the apron repeats the last texel
      if (part.macroblocks[next] == VolumePart::kEmpty) continue;
      ++(isLast ? last : pairs);
      for (uint32_t i = 0; i < 81; ++i) {
        std::array<uint32_t, 3> here = {i % 9, i % 9, i / 9}, there;
        if (axis == 2) here[1] = i / 9;
        there = here;
        here[axis] = 8;
        there[axis] = isLast ? 7 : 0;
        ASSERT_TRUE(std::equal(texel(part.macroblocks[b], here), texel(part.macroblocks[b], here) + 8,
                               texel(part.macroblocks[next], there)))
            << "macroblock " << b << ", axis " << axis;
        here[axis] = 7;
        alike += !isLast && std::equal(texel(part.macroblocks[b], here), texel(part.macroblocks[b], here) + 8,
                                       texel(part.macroblocks[next], there));
      }
    }
  }
  EXPECT_GT(pairs, 20);
  EXPECT_GT(last, 5);
  EXPECT_LT(alike, 81 * pairs / 2) << "equal neighbouring texels would make the test vacuous";
}

// Invariant 4 of docs/invariants.md, for baked parts: every position has one owner, the block that was trained there.
TEST(BakeVolume, GivesEveryPlaceToTheBlockThatWasTrainedThere) {
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  BlockGrid grid = cubeGrid(3);  // 3 × 3 blocks, of which one is not at the border
  grid.rows = 3;
  grid.bottom = -0.3;  // the box is lower than the blocks' domains
  grid.top = 0.3;
  for (const char* backgroundBlock : {"none", "own", "border"}) {
    VolumeConfig config = smallVolumeConfig();
    config.backgroundBlock = backgroundBlock;
    VolumeModel model(*device, config, grid);
    const BlockSpace& space = model.space();
    std::vector<VolumePart> parts;
    for (uint32_t block = 0; block < space.blocks(); ++block) {
      parts.push_back(bakePart(model, block, OccupiedTexels(model.virtualGrid())));
    }
    const RandomStream random(7, 0xba4e);
    int inside = 0, beyond = 0;
    for (uint64_t i = 0; i < 20000; ++i) {
      double x[3];
      for (uint64_t a = 0; a < 3; ++a) {
        x[a] = (i % 2 ? 3.0 : 9.0) * (2 * random.uniformDouble(4 * i + a) - 1) * (a == 2 ? 0.5 : 1);
      }
      const bool inBox = std::abs(x[0]) < 3 && std::abs(x[1]) < 3 && x[2] > space.bottom && x[2] < space.top;
      if (!inBox && space.backgroundBlock == BackgroundBlockMode::none) continue;  // nothing is drawn there
      const uint32_t trained = space.blockAt(x[0], x[1], x[2]);
      const BlockSpace::Placement placement = space.placement(trained);
      std::vector<uint32_t> expected = {trained}, owners;
      for (int a = 0; a < 3; ++a) {  // outside its domain, a bounded block is empty (compute/blocks.h)
        const bool within = std::abs(x[a] - placement.centre[a]) <= placement.scale[a];
        if (!placement.contracted && !within) expected.clear();
      }
      for (uint32_t block = 0; block < parts.size(); ++block) {
        const VolumePart& part = parts[block];
        if (part.backgroundBlock && inBox) continue;  // it is visible only outside the box
        bool owns = true;
        for (int a = 0; a < 3; ++a) owns = owns && part.low[a] <= x[a] && x[a] < part.high[a];
        if (owns) owners.push_back(block);
      }
      ASSERT_EQ(owners, expected) << backgroundBlock << ": " << x[0] << " " << x[1] << " " << x[2];
      ++(inBox ? inside : beyond);
    }
    EXPECT_GT(inside, 1000);
    EXPECT_TRUE(beyond > 1000 || space.backgroundBlock == BackgroundBlockMode::none);
  }
}

TEST(BakeVolume, RendersLikeTheModelThatItWasBakedFrom) {
  const TemporaryFolder folder;
  for (const char* backgroundBlock : {"none", "own"}) {
    CubeScene::Options surroundings;
    surroundings.isEnclosed = backgroundBlock == std::string("own");
    const CubeScene scene(surroundings);
    VolumeConfig config = smallVolumeConfig();
    config.backgroundBlock = backgroundBlock;
    BlockGrid grid = cubeGrid(2);  // like a grid given by the user: its origin is not in the middle of the heights
    grid.originInWorld.z() += grid.bottom;
    grid.top -= grid.bottom;
    grid.bottom = 0;
    TrainedVolumeCube trained(scene, config, grid, 300);
    const BakedScene baked = bakeVolume(onlyLevel(trained), 1, scene.capture(), folder / backgroundBlock, {});
    EXPECT_EQ(baked.tileset.tiles.size(), 3u);
    VolumeModelRenderer model(trained.model(), static_cast<float>(config.cullLast));
    const std::unique_ptr<VolumeRenderer> tiles = openScene(folder / backgroundBlock);
    const double ofModel = heldOutPsnr(scene, model), ofTiles = heldOutPsnr(scene, *tiles);
    // Without a background block, the scene is 0.19 dB below its model: renderers take one step per texel, and here a
    // block has only 64 of them. With two steps per texel it is 0.09 dB above. In a city with 512 texels per block,
    // bench/volume.sh allows 0.15 dB.
    EXPECT_GT(ofModel, 20) << backgroundBlock;
    EXPECT_NEAR(ofTiles, ofModel, 0.25) << backgroundBlock;
  }
}

TEST(BakeVolume, RendersLikeTheModelOutsideTheBoxToo) {
  CubeScene::Options options;
  options.isEnclosed = true;  // with walls far outside the blocks
  const CubeScene scene(options);
  const TemporaryFolder folder;
  for (const char* backgroundBlock : {"own", "border"}) {
    VolumeConfig config = smallVolumeConfig();
    config.backgroundBlock = backgroundBlock;
    TrainedVolumeCube trained(scene, config, cubeGrid(2), 200);
    bakeVolume(onlyLevel(trained), 1, scene.capture(), folder / backgroundBlock, {});
    VolumeModelRenderer model(trained.model(), static_cast<float>(config.cullLast));
    const std::unique_ptr<VolumeRenderer> tiles = openScene(folder / backgroundBlock);
    const Camera& camera = scene.capture().cameras[0];
    for (const int photo : {0, 11}) {
      const Pose& pose = scene.capture().photos[photo].worldFromCamera;
      const RenderedView a = model.render(camera, pose, nullptr), b = tiles->render(camera, pose, nullptr);
      EXPECT_GT(computePsnr(b, a), 27) << backgroundBlock;
      int far = 0;  // pixels of a wall
      for (const float depth : b.depth.pixels) far += depth > 3;
      EXPECT_GT(far, 150) << backgroundBlock;
    }
  }
}

TEST(BakeVolume, NestsLevelsOfDetail) {
  const CubeScene scene;
  const TemporaryFolder folder;
  const std::unique_ptr<Device> device = makeDevice({"cpu", 2});
  TrainVolumeOptions options;
  options.config = smallVolumeConfig();
  options.blocks = *parseBlockCount("2x2");
  options.loop.steps = 60;
  options.config.lodStepFraction = 0.5;
  options.loop.progress = false;
  trainVolume(*device, scene.capture(), folder / "model", options);
  ASSERT_EQ(trainedLevels<VolumeConfig>(folder / "model"), 2u);
  BakeOptions baking;
  baking.stride = 8;
  const BakedScene baked =
      bakeVolume([&](uint32_t level) { return loadVolumeModel(*device, levelFolder(folder / "model", level)); }, 2,
                 scene.capture(), folder / "scene", baking);
  ASSERT_EQ(baked.tileset.tiles.size(), 5u);
  const Tile& root = baked.tileset.tiles[0];
  EXPECT_EQ(root.children.size(), 4u);
  EXPECT_EQ(root.level, 1u);
  EXPECT_NEAR(root.geometricError, 2 * baked.tileset.tiles[1].geometricError, 1e-9);
  const VolumeContent merged =
      contentAs<VolumeContent>(*readContent(contentPath(folder / "scene", root.contents.at(0).uri), volumeCodec()));
  EXPECT_EQ(merged.parts.size(), 4u) << "one part for each block, with its own texels";
  EXPECT_EQ(merged.parts[0].planes, 32u);
  // A coarser level is baked with twice the pixel stride, because its texels are twice as large.
  const std::unique_ptr<VolumeModel> coarse = loadVolumeModel(*device, levelFolder(folder / "model", 1));
  const auto seenThroughEvery = [&](int stride) {
    BakeOptions looking;
    looking.stride = stride;
    return bakePart(*coarse, 0, findOccupiedTexels(*coarse, scene.capture(), looking)[0]);
  };
  EXPECT_EQ(merged.parts[0].planeBytes, seenThroughEvery(16).planeBytes);
  EXPECT_NE(merged.parts[0].planeBytes, seenThroughEvery(8).planeBytes);
  // The scene can be rendered at either level.
  for (const int finest : {0, 1}) {
    TileScene opened = openTileScene(folder / "scene", volumeCodec());
    SceneRendererSettings settings;
    settings.selection.maximumScreenSpaceError = 0;
    settings.selection.finestLevel = finest;
    VolumeRenderer renderer(opened.frame, std::move(opened.tree), std::move(opened.source), settings);
    const RenderedView view =
        renderer.render(scene.capture().cameras[0], scene.capture().photos[0].worldFromCamera, nullptr);
    EXPECT_EQ(renderer.cut().tiles.size(), finest == 0 ? 4u : 1u);
    for (const float value : view.colour.pixels) ASSERT_TRUE(std::isfinite(value));
  }
}

TEST(BakeVolume, RendersTheSameWhenBakedOnVulkan) {
#ifndef TESSERA_HAS_VULKAN
  GTEST_SKIP() << "this build has no Vulkan";
#else
  SKIP_WITHOUT_VULKAN(openForTest());
  const CubeScene scene;
  const TemporaryFolder folder;
  TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(2), 200);
  const std::vector<Bytes> saved = trained.saved();
  const std::unique_ptr<Device> vulkan = makeDevice({"vulkan"});
  const auto drawn = [&](Device& device, const char* name) {
    const LevelModels models = [&](uint32_t) {
      auto model = std::make_unique<VolumeModel>(device, trained.model().config(), trained.model().grid());
      for (uint32_t block = 0; block < saved.size(); ++block) {
        const fs::path path = folder / ("block" + std::to_string(block));
        writeFileAtomically(path, saved[block]);
        model->restore(block, path, readSafetensors(path));
      }
      return model;
    };
    bakeVolume(models, 1, scene.capture(), folder / name, {});
    return openScene(folder / name)
        ->render(scene.capture().cameras[0], scene.capture().photos[0].worldFromCamera, nullptr);
  };
  EXPECT_GT(computePsnr(drawn(*vulkan, "vulkan"), drawn(*trained.device, "cpu")), 40);
  EXPECT_EQ(GpuContext::validationMessages(), 0);
#endif
}

TEST(BakeVolume, CullsBelowTheLastThresholdOfTraining) {
  const CubeScene scene;
  const TemporaryFolder folder;
  VolumeConfig config = smallVolumeConfig();
  config.cullLast = 0.3;
  TrainedVolumeCube trained(scene, config, cubeGrid(), 60);
  BakeOptions options;
  options.stride = 4;
  const BakedScene baked = bakeVolume(onlyLevel(trained), 1, scene.capture(), folder / "scene", options);
  const auto contentAbove = [&](double minAlpha) {
    BakeOptions looking = options;
    looking.minAlpha = minAlpha;
    const std::vector<OccupiedTexels> occupied = findOccupiedTexels(trained.model(), scene.capture(), looking);
    return encodeVolume(bakeGroup(trained.model(), 0, occupied), options.effort);
  };
  const Bytes content = readFile(contentPath(folder / "scene", baked.tileset.root().contents.at(0).uri));
  EXPECT_EQ(content, contentAbove(config.cullLast));
  EXPECT_NE(content, contentAbove(options.minAlpha));
}

TEST(BakeVolume, WritesTheSameSceneAgain) {
  const CubeScene scene;
  const TemporaryFolder folder;
  TrainedVolumeCube trained(scene, smallVolumeConfig(), cubeGrid(), 60);
  const BakedScene once = bakeVolume(onlyLevel(trained), 1, scene.capture(), folder / "scene", {});
  const std::string text = readTextFile(folder / "scene/tileset.json");
  const BakedScene again = bakeVolume(onlyLevel(trained), 1, scene.capture(), folder / "scene", {});
  EXPECT_EQ(readTextFile(folder / "scene/tileset.json"), text);
  EXPECT_EQ(once.levels.at(0).bytesOnDisk, again.levels.at(0).bytesOnDisk);
  EXPECT_EQ(readTileset(folder / "scene").tiles.size(), 1u) << "one block is its own root";
}

TEST(BakeVolume, StoresNothingWhereNothingIsMarked) {
  const CubeScene scene;
  TrainedVolumeCube untrained(scene, smallVolumeConfig(), cubeGrid(), 0);
  const VolumeContent content = bakeGroup(untrained.model(), 0, {OccupiedTexels(untrained.model().virtualGrid())});
  EXPECT_EQ(content.parts[0].storedMacroblocks(), 0u);
  EXPECT_FALSE(validationError(content));
  for (const uint8_t distance : content.parts[0].distances) EXPECT_EQ(distance, 255);
}

}  // namespace
}  // namespace tessera
