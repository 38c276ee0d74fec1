#include "representations/mesh/cpu/mesh_drawer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "render/scene_tiles.h"
#include "representations/mesh/cpu/mesh_tracer.h"
#include "tiles/bc4.h"

namespace tessera {
namespace {

// A square [x0, x1] × [y0, y1] at a height, of one colour (its red) and opacity.
PatchSet squareSet(double x0, double y0, double x1, double y1, double height, float red, uint8_t opacity) {
  PatchSet set;
  set.patches = set.pairs = 1;
  set.origin = {x0, y0, height};
  set.step = std::max(x1 - x0, y1 - y0) / 1000;
  const uint16_t right = static_cast<uint16_t>(std::lround((x1 - x0) / set.step)),
                 upper = static_cast<uint16_t>(std::lround((y1 - y0) / set.step));
  set.vertices = {0, 0, 0, right, 0, 0, 0, upper, 0, right, upper, 0};
  set.featureBlocks.fill(std::vector<uint8_t>(4 * PatchSet::kBc5Bytes));
  for (int block = 0; block < 4; ++block) {
    const Bc4Block encoded = encodeBc4(
        [&] {
          Bc4Texels texels;
          texels.fill(opacity);
          return texels;
        }(),
        Bc4Effort::fast);
    set.opacityBlocks.insert(set.opacityBlocks.end(), encoded.begin(), encoded.end());
  }
  DenseLayer layer{kMeshFeatures + kMeshHarmonics, 3, {}, {}};
  layer.weights.resize(size_t{layer.inputs} * 3);
  layer.biases = {std::log(red / (1 - red)), 0, 0};
  set.decoder = {layer};
  return set;
}

// Draws contents as tiles and one as the background block.
class DrawMesh : public testing::Test {
 protected:
  const Content* prepare(MeshContent mesh) {
    contents_.push_back(drawer_->prepare(makeContent(std::move(mesh)), 1));
    return contents_.back().get();
  }
  // The colour, opacity and depth seen straight down from (x, y, 10).
  struct Seen {
    float red, opacity, depth;
  };
  Seen look(double x, double y, float opaqueDepth = INFINITY) {
    Camera camera;
    camera.width = camera.height = 1;
    camera.parameters = {1, 1, 0.5, 0.5};
    Pose pose;
    pose.translation = {x, y, 10};
    pose.rotation << 1, 0, 0, 0, -1, 0, 0, 0, -1;
    const ImageF opaque(1, 1, 1, opaqueDepth);
    DrawSettings settings;
    settings.minTransmittance = 0;
    const RenderedView image = drawer_->draw(view_, {camera, pose, &opaque}, settings, pool_, counts_);
    return {*image.colour.at(0, 0), *image.opacity.at(0, 0), *image.depth.at(0, 0)};
  }

  const std::unique_ptr<CpuDrawer> drawer_ = makeMeshDrawer();
  std::vector<std::unique_ptr<Content>> contents_;
  SceneView<Content> view_;
  ThreadPool pool_{1};
  DrawCounts counts_;
};

TEST_F(DrawMesh, CompositesTheHitsOfAllContentsInOrder) {
  view_.frontToBack.emplace_back(prepare({false, 0, {}, {squareSet(-1, -1, 1, 1, 0, 0.8f, 255)}}));
  view_.frontToBack.emplace_back(prepare({false, 0, {}, {squareSet(-1, -1, 1, 1, 0.5, 0.2f, 51)}}));
  const Seen seen = look(0.3, 0.2);
  EXPECT_NEAR(seen.red, 0.2f * 0.2f + 0.8f * 0.8f, 1e-4);
  EXPECT_NEAR(seen.opacity, 1, 1e-6);
  EXPECT_NEAR(seen.depth, 0.2f * 9.5f + 0.8f * 10, 1e-4);
  EXPECT_EQ(counts_.samples, 2u);
  EXPECT_EQ(look(1.5, 0).opacity, 0);
}

TEST_F(DrawMesh, LimitsACoarseContentToTheCellsThatItStandsFor) {
  const Content* const coarse = prepare({false, 0, {}, {squareSet(-2, -2, 2, 2, 0, 0.5f, 255)}});
  view_.frontToBack.emplace_back(coarse, Vec3d(-INFINITY, -INFINITY, -INFINITY), Vec3d(0, INFINITY, INFINITY));
  EXPECT_NEAR(look(-1, 1).opacity, 1, 1e-6);
  EXPECT_EQ(look(1, 1).opacity, 0);
}

TEST_F(DrawMesh, ShowsTheBackgroundBehindTheBoxAndTheSkyBehindAll) {
  view_.frame.low = {-1, -1, -1};
  view_.frame.high = {1, 1, 1};
  MeshContent background{true, 2, std::vector<uint8_t>(6 * 4 * 3, 51), {squareSet(-4, -4, 4, 4, -2, 0.5f, 255)}};
  background.parts.push_back(squareSet(-4, -4, 4, 4, 0, 0.9f, 255));   // within the box, where it counts for no ray
  background.parts.push_back(squareSet(-4, -4, -3, 4, 3, 0.75f, 51));  // beside the box, and above it
  view_.backgroundBlock = prepare(background);
  view_.frontToBack.emplace_back(prepare({false, 0, {}, {squareSet(-1, -1, 1, 1, 0.5, 0.2f, 51)}}));
  const Seen through = look(0.5, 0.5);
  EXPECT_NEAR(through.red, 0.2f * 0.2f + 0.8f * 0.5f, 1e-4);
  EXPECT_NEAR(through.depth, 0.2f * 9.5f + 0.8f * 12, 1e-3);
  const Seen beside = look(-3.5, 0.5);
  EXPECT_NEAR(beside.red, 0.2f * 0.75f + 0.8f * 0.9f, 1e-4);
  const Seen sky = look(6, 0);
  EXPECT_NEAR(sky.red, 0.2f, 1e-4);
  EXPECT_EQ(sky.opacity, 1);
  EXPECT_EQ(sky.depth, 0);
}

TEST_F(DrawMesh, EndsRaysAtModels) {
  MeshContent background{true, 2, std::vector<uint8_t>(6 * 4 * 3, 51), {squareSet(-4, -4, 4, 4, -2, 0.5f, 255)}};
  view_.backgroundBlock = prepare(background);
  view_.frontToBack.emplace_back(prepare({false, 0, {}, {squareSet(-1, -1, 1, 1, 0.5, 0.2f, 51)}}));
  EXPECT_NEAR(look(0, 0.5, 9).opacity, 0, 1e-6);
  EXPECT_NEAR(look(0, 0.5, 11).opacity, 0.2f, 1e-6);
  EXPECT_NEAR(look(0, 0.5, 13).opacity, 1, 1e-6);
}

TEST_F(DrawMesh, TakesNoMoreMemoryThanItStatesForManyParts) {
  for (const bool isEmpty : {false, true}) {
    PatchSet set = squareSet(0, 0, 1, 1, 0, 0.5f, 255);
    if (isEmpty) {
      set.patches = set.pairs = 0;
      set.vertices.clear();
      set.featureBlocks.fill({});
      set.opacityBlocks.clear();
    }
    MeshContent mesh{false, 0, {}, std::vector<PatchSet>(1000, set)};
    const uint64_t decoded = bytesInMemory(mesh), stated = drawer_->residentBytes(decoded);
    EXPECT_LE(prepare(std::move(mesh))->memoryBytes(), stated) << decoded << " bytes when decoded";
  }
}

TEST_F(DrawMesh, TakesNoMoreMemoryThanItStates) {
  const std::pair<uint32_t, uint32_t> sizes[] = {{1, 8}, {100, 8}, {20000, 8}, {100, 4}, {100000, 4}};
  for (const auto [patches, patchEdge] : sizes) {
    PatchSet set = squareSet(0, 0, 1, 1, 0, 0.5f, 255);
    set.patches = set.pairs = patches;
    set.patchEdge = patchEdge;
    set.vertices.clear();
    for (uint32_t i = 0; i < patches; ++i) {
      const uint16_t x = static_cast<uint16_t>(i % 150 * 7), y = static_cast<uint16_t>(i / 150 * 7),
                     z = static_cast<uint16_t>(i * 7919 % 500);
      const uint16_t right = x + 7, upper = y + 7;
      set.vertices.insert(set.vertices.end(), {x, y, z, right, y, z, x, upper, z, right, upper, z});
    }
    for (auto& blocks : set.featureBlocks) blocks.resize(set.textureBlocks() * PatchSet::kBc5Bytes);
    set.opacityBlocks.resize(set.textureBlocks() * PatchSet::kBc4Bytes);
    MeshContent mesh{false, 0, {}, {set}};
    const uint64_t decoded = bytesInMemory(mesh), stated = drawer_->residentBytes(decoded);
    const uint64_t resident = prepare(std::move(mesh))->memoryBytes();
    EXPECT_LE(resident, stated) << patches << " patches of " << patchEdge << " texels, " << decoded
                                << " bytes when decoded";
    EXPECT_GT(resident, decoded);
  }
}

TEST(MeshDrawer, KeepsFinerLevelsLongerUnlessTheCallerSaysHowLong) {
  const std::unique_ptr<CpuDrawer> drawer = makeMeshDrawer();
  SelectionSettings settings;
  EXPECT_EQ(selectionFor(*drawer, settings).hysteresis, 1.5);
  settings.hysteresis = 1.1;
  EXPECT_EQ(selectionFor(*drawer, settings).hysteresis, 1.1);
}

}  // namespace
}  // namespace tessera
