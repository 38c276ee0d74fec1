#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "gpu/testing/test_context.h"
#include "render/testing/source_of_copies.h"
#include "render/vulkan/gpu_scene_renderer.h"
#include "representations/hash/testing/hash_renderer.h"
#include "representations/hash/testing/test_hash_content.h"
#include "representations/hash/vulkan/gpu_hash_drawer.h"
#include "representations/mesh/cpu/mesh_drawer.h"
#include "representations/mesh/testing/random_mesh.h"
#include "representations/mesh/vulkan/gpu_mesh_drawer.h"
#include "representations/volume/testing/test_scene.h"
#include "representations/volume/testing/volume_renderer.h"
#include "representations/volume/vulkan/gpu_volume_drawer.h"

namespace tessera {
namespace {

double decibels(const ImageF& a, const ImageF& b) {
  double squares = 1e-12, largest = 1e-6;
  for (size_t i = 0; i < a.pixels.size(); ++i) {
    squares += std::pow(a.pixels[i] - b.pixels[i], 2);
    largest = std::max<double>(largest, std::abs(b.pixels[i]));
  }
  return 10 * std::log10(static_cast<double>(a.pixels.size()) * largest * largest / squares);
}

// 2x2 cells of synthetic features below one content of all of them, which has a network of its own, and a background
// block.
struct HashPlace {
  TileTree tree = testTree(2, 2);
  std::vector<HashContent> contents;
  TileFrame frame;
  uint64_t allBytes = 0, coarsestBytes = 0;

  // `adapt` changes a content before it is used.
  explicit HashPlace(
      uint32_t cells, const std::function<void(HashContent&)>& adapt = [](HashContent&) {}) {
    frame.low = Vec3d(-2, -2, -1);
    frame.high = Vec3d(2, 2, 1);
    for (TileNode& node : tree.tiles) {
      std::vector<HashPart> parts;
      for (double y = node.low.y(); y < node.high.y(); y += 2) {
        for (double x = node.low.x(); x < node.high.x(); x += 2) {
          HashPart part;
          part.centre = {static_cast<float>(x + 1), static_cast<float>(y + 1), 0};
          part.low = {static_cast<float>(x), static_cast<float>(y), -1};
          part.high = {static_cast<float>(x + 2), static_cast<float>(y + 2), 1};
          const Vec3d middle(x + 1, y + 1, 0);
          makeHash(part, {16, cells, 0.5f, [](const Vec3d& at) { return at.z() < 0.3; }},
                   [&](const Vec3d& at) { return smoothFeatures(at + middle); });
          parts.push_back(std::move(part));
        }
      }
      add(makeHashContent(std::move(parts), testHashNetwork(node.level)), adapt);
      node.geometricError = 2.0 / 64 * (1 << node.level);
      if (node.parent < 0) coarsestBytes += bytesInMemory(contents.back());
    }
    HashPart around;
    around.contracted = around.backgroundBlock = true;
    around.scale = {2, 2, 1};
    makeHash(around, {16, 32, 0.5f, [](const Vec3d& at) { return at.norm() > 1.2; }}, smoothFeatures);
    add(makeHashContent({around}, testHashNetwork(0)), adapt);
    coarsestBytes += bytesInMemory(contents.back());
    tree.backgroundBlock = static_cast<int>(tree.tiles.size());
    tree.tiles.emplace_back().isBackgroundBlock = true;
  }
  void add(HashContent content, const std::function<void(HashContent&)>& adapt) {
    adapt(content);
    allBytes += bytesInMemory(content);
    contents.push_back(std::move(content));
  }
  TileSource<Content> source() const {
    return sourceOfCopies([this](int tile) -> const HashContent& { return contents[tile]; });
  }
};

// Makes the level weights the same everywhere: only feature columns remain.
void withoutLogitColumns(HashContent& content) {
  for (HashPart& part : content.parts) {
    std::vector<uint8_t> features;
    for (size_t corner = 0; corner < part.cornerBytes.size() / 16; ++corner) {
      const auto first = part.cornerBytes.begin() + static_cast<std::ptrdiff_t>(16 * corner);
      features.insert(features.end(), first, first + 8);
    }
    part.cornerBytes = std::move(features);
    part.columns = 8;
    part.ranges.resize(8);
  }
}

// 2x2 cells of random triangles, which reach into other cells, below one content of all of them, and a background block
// with a sky.
struct MeshPlace {
  TileTree tree = testTree(2, 2);
  std::vector<MeshContent> contents;
  TileFrame frame;
  uint64_t allBytes = 0, coarsestBytes = 0;

  // `areInferred`: whether an encoder stands for the maps of a part of each tile.
  explicit MeshPlace(bool areInferred = false) {
    frame.low = Vec3d(-2, -2, -1);
    frame.high = Vec3d(2, 2, 1);
    for (TileNode& node : tree.tiles) {
      MeshContent content = areInferred ? tiles_test::inferredMeshContent(contents.size())
                                        : tiles_test::randomMeshContent(contents.size(), 3);
      const double growth = node.level == 0 ? 1 : 2;
      for (PatchSet& part : content.parts) {
        part.step *= growth;
        for (int axis = 0; axis < 3; ++axis) {
          const double middle = (node.low[axis] + node.high[axis]) / 2;
          part.origin[axis] = growth * part.origin[axis] + middle;
          if (!part.encoder) continue;
          part.encoder->scale[axis] /= growth;
          part.encoder->offset[axis] -= part.encoder->scale[axis] * middle;
        }
      }
      add(std::move(content));
      node.geometricError = 2.0 / 64 * (1 << node.level);
      if (node.parent < 0) coarsestBytes += bytesInMemory(contents.back());
    }
    MeshContent around = tiles_test::randomMeshContent(1000, 3, true);
    for (PatchSet& part : around.parts) {
      part.step *= 8;
      for (double& number : part.origin) number *= 8;
    }
    add(std::move(around));
    coarsestBytes += bytesInMemory(contents.back());
    tree.backgroundBlock = static_cast<int>(tree.tiles.size());
    tree.tiles.emplace_back().isBackgroundBlock = true;
  }
  void add(MeshContent content) {
    allBytes += bytesInMemory(content);
    contents.push_back(std::move(content));
  }
  TileSource<Content> source() const {
    return sourceOfCopies([this](int tile) -> const MeshContent& { return contents[tile]; });
  }
};

class MeshRenderer final : public SceneRenderer {
 public:
  MeshRenderer(const TileFrame& frame, TileTree tree, TileSource<Content> source, const SceneRendererSettings& settings)
      : SceneRenderer(makeMeshDrawer(), frame, std::move(tree), std::move(source), settings) {}
};

class GpuDrawing : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
  }
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }

  GpuSceneRenderer onGpu(const Place& place, const GpuRendererSettings& settings) {
    const auto stream = std::make_shared<GpuStream>(context_);
    return {stream, makeGpuVolumeDrawer(stream), {place.frame, place.tree, place.source(), {}}, settings};
  }
  GpuSceneRenderer onGpu(const HashPlace& place, const GpuRendererSettings& settings) {
    const auto stream = std::make_shared<GpuStream>(context_);
    return {stream, makeGpuHashDrawer(stream), {place.frame, place.tree, place.source(), {}}, settings};
  }

  GpuSceneRenderer onGpu(const MeshPlace& place, const GpuRendererSettings& settings) {
    const auto stream = std::make_shared<GpuStream>(context_);
    return {stream, makeGpuMeshDrawer(stream), {place.frame, place.tree, place.source(), {}}, settings};
  }

  // Compares the images of both renderers along a flight.
  template <class Oracle, class Place>
  void compare(const Place& place, uint64_t budget, double maximumScreenSpaceError,
               const ImageF* opaqueDepth = nullptr) {
    SceneRendererSettings settings;
    settings.budgetBytes = budget;
    settings.selection.maximumScreenSpaceError = maximumScreenSpaceError;
    Oracle oracle(place.frame, place.tree, place.source(), settings);
    GpuRendererSettings ofGpu;
    ofGpu.budgetBytes = budget;
    ofGpu.selection = settings.selection;
    GpuSceneRenderer gpu = onGpu(place, ofGpu);
    for (int step = 0; step < 600; step += 75) {
      SCOPED_TRACE(step);
      const RenderedView expected = oracle.render(flightCamera(), flightPose(step), opaqueDepth);
      const RenderedView actual = gpu.render(flightCamera(), flightPose(step), opaqueDepth);
      EXPECT_GT(decibels(actual.colour, expected.colour), 55);
      EXPECT_GT(decibels(actual.opacity, expected.opacity), 55);
      EXPECT_GT(decibels(actual.depth, expected.depth), 45);
      ASSERT_EQ(gpu.cut().tiles.size(), oracle.cut().tiles.size());
      for (size_t i = 0; i < oracle.cut().tiles.size(); ++i) {
        EXPECT_EQ(gpu.cut().tiles[i].content, oracle.cut().tiles[i].content);
      }
      EXPECT_LE(gpu.cache().statistics().maxBytes, budget);
    }
  }

  std::shared_ptr<GpuContext> context_;
};

ImageF opaqueOnTheLeft() {
  ImageF opaque(flightCamera().width, flightCamera().height, 1, INFINITY);
  for (int y = 0; y < opaque.height; ++y) {
    for (int x = 0; x < opaque.width / 2; ++x) *opaque.at(x, y) = 3;
  }
  return opaque;
}

TEST_F(GpuDrawing, DrawsVolumeAsTheCpuDoes) {
  compare<VolumeRenderer>(place(), place().allBytes, 1.5);
}

TEST_F(GpuDrawing, DrawsTheSameCutWithinABudget) {
  compare<VolumeRenderer>(place(), place().finestBytes / 3, 0.5);
}

TEST_F(GpuDrawing, EndsRaysOfVolumeWhereSomethingOpaqueStands) {
  const ImageF opaque = opaqueOnTheLeft();
  compare<VolumeRenderer>(place(), place().allBytes, 16, &opaque);
}

TEST_F(GpuDrawing, DrawsHashAsTheCpuDoes) {
  const HashPlace hashPlace(32);
  compare<HashRenderer>(hashPlace, hashPlace.allBytes, 1.5);
}

TEST_F(GpuDrawing, DrawsHashOfSeveralNetworksWithinABudget) {
  const HashPlace hashPlace(32);
  compare<HashRenderer>(hashPlace, hashPlace.coarsestBytes + (hashPlace.allBytes - hashPlace.coarsestBytes) / 2, 0.5);
}

TEST_F(GpuDrawing, SkipsEmptySpaceInTwoDistanceGrids) {
  const HashPlace hashPlace(136);
  ASSERT_GT(hashPlace.contents.front().parts.front().distances.ratio, 1u);
  compare<HashRenderer>(hashPlace, hashPlace.allBytes, 16);
}

TEST_F(GpuDrawing, WeighsLevelsOfHashInEveryWay) {
  const HashPlace shared(32, [](HashContent& content) { content.weights = LevelWeights::shared; });
  compare<HashRenderer>(shared, shared.allBytes, 16);
  const HashPlace none(32, [](HashContent& content) {
    content.weights = LevelWeights::none;
    withoutLogitColumns(content);
  });
  compare<HashRenderer>(none, none.allBytes, 16);
  const HashPlace everywhere(32, [](HashContent& content) {
    content.logits = {0.7f, -1.2f};
    withoutLogitColumns(content);
  });
  compare<HashRenderer>(everywhere, everywhere.allBytes, 16);
}

TEST_F(GpuDrawing, ShowsTheLearnedBackgroundOfHashWhereNothingIs) {
  const HashPlace whole(32, [](HashContent& content) { content.hasLearnedBackground = true; });
  compare<HashRenderer>(whole, whole.allBytes, 1.5);
  const ImageF opaque = opaqueOnTheLeft();
  compare<HashRenderer>(whole, whole.allBytes, 16, &opaque);
}

// Compares images of triangles, which may differ in a few pixels: a rasteriser rounds positions of corners, and so
// moves edges by a fraction of a pixel.
void expectSamePixels(const RenderedView& actual, const RenderedView& expected, double share) {
  int differences = 0;
  for (int y = 0; y < expected.colour.height; ++y) {
    for (int x = 0; x < expected.colour.width; ++x) {
      float largest = std::abs(*actual.opacity.at(x, y) - *expected.opacity.at(x, y));
      for (int c = 0; c < 3; ++c)
        largest = std::max(largest, std::abs(actual.colour.at(x, y)[c] - expected.colour.at(x, y)[c]));
      const float depth = *expected.depth.at(x, y);
      if (largest > 2e-3f || std::abs(*actual.depth.at(x, y) - depth) > 2e-3f * std::max(1.0f, depth)) ++differences;
    }
  }
  EXPECT_LE(differences, share * expected.opacity.pixels.size());
}

TEST_F(GpuDrawing, DrawsMeshAsTheCpuDoes) {
  const MeshPlace mesh;
  const ImageF opaque = opaqueOnTheLeft();
  for (const ImageF* const end : {static_cast<const ImageF*>(nullptr), &opaque}) {
    for (const double error : {0.5, 16.0}) {
      SceneRendererSettings settings;
      // CPU contents take more memory, so both have enough for all.
      settings.selection.maximumScreenSpaceError = error;
      MeshRenderer oracle(mesh.frame, mesh.tree, mesh.source(), settings);
      GpuRendererSettings ofGpu;
      ofGpu.selection = settings.selection;
      GpuSceneRenderer gpu = onGpu(mesh, ofGpu);
      for (int step = 0; step < 600; step += 75) {
        SCOPED_TRACE(step);
        expectSamePixels(gpu.render(flightCamera(), flightPose(step), end),
                         oracle.render(flightCamera(), flightPose(step), end), 0.005);
      }
    }
  }
}

TEST_F(GpuDrawing, DrawsMeshInStripsIfItsFragmentsDoNotFitIntoMemory) {
  const MeshPlace mesh;
  const auto draw = [&](uint32_t listedFragments) {
    const auto stream = std::make_shared<GpuStream>(context_);
    GpuSceneRenderer gpu(stream, makeGpuMeshDrawer(stream, {.listedFragments = listedFragments}),
                         {mesh.frame, mesh.tree, mesh.source(), {}}, {});
    return gpu.render(flightCamera(), flightPose(0), nullptr);
  };
  const RenderedView whole = draw(0), inStrips = draw(2000);
  EXPECT_EQ(inStrips.colour.pixels, whole.colour.pixels);
  EXPECT_EQ(inStrips.opacity.pixels, whole.opacity.pixels);
  EXPECT_THROW(draw(2), Error);
}

TEST_F(GpuDrawing, DrawsMapsInferredOnTheGpuAsThoseOfTheCpu) {
  const MeshPlace mesh(true);
  const auto makeRenderer = [&](MeshInference inference) {
    const auto stream = std::make_shared<GpuStream>(context_);
    GpuRendererSettings settings;
    settings.selection.maximumScreenSpaceError = 0.5;
    return std::make_unique<GpuSceneRenderer>(stream, makeGpuMeshDrawer(stream, {.inference = inference}),
                                              TileScene{mesh.frame, mesh.tree, mesh.source(), {}}, settings);
  };
  const auto byCpu = makeRenderer(MeshInference::cpu), byGpu = makeRenderer(MeshInference::gpu);
  const auto automatic = makeRenderer(MeshInference::automatic);
  for (int step = 0; step < 600; step += 150) {
    SCOPED_TRACE(step);
    const RenderedView expected = byCpu->render(flightCamera(), flightPose(step), nullptr);
    EXPECT_GT(decibels(byGpu->render(flightCamera(), flightPose(step), nullptr).colour, expected.colour), 45);
    EXPECT_GT(decibels(automatic->render(flightCamera(), flightPose(step), nullptr).colour, expected.colour), 45);
  }
}

TEST_F(GpuDrawing, DitheredFramesOfMeshHaveTheExactImageAsTheirMean) {
  const MeshPlace mesh;
  const auto stream = std::make_shared<GpuStream>(context_);
  GpuRendererSettings settings;
  settings.draw.exact = false;
  GpuMeshSettings unjittered;
  unjittered.jitters = false;
  GpuSceneRenderer gpu(stream, makeGpuMeshDrawer(stream, unjittered), {mesh.frame, mesh.tree, mesh.source(), {}},
                       settings);
  for (int step = 0; step < 600; step += 200) {
    SCOPED_TRACE(step);
    const RenderedView expected = gpu.render(flightCamera(), flightPose(step), nullptr);
    gpu.draw(flightCamera(), flightPose(step));
    const double once = decibels(gpu.lastImage().colour, expected.colour);
    EXPECT_TRUE(gpu.hasMore());
    int frames = 1;
    for (; gpu.hasMore(); ++frames) gpu.draw(flightCamera(), flightPose(step));
    EXPECT_EQ(frames, 64);
    const double mean = decibels(gpu.lastImage().colour, expected.colour);
    // Independent frames would gain 18 dB, but what several layers decide together is not stratified.
    EXPECT_GT(mean, once + 10);
    while (frames < 512) {
      gpu.draw(flightCamera(), flightPose(step));
      ++frames;
    }
    EXPECT_GT(decibels(gpu.lastImage().colour, expected.colour), mean + 5);
  }
}

// Returns the mean of squares of `edge` × `edge` pixels.
ImageF shrink(const ImageF& image, int edge) {
  ImageF mean(image.width / edge, image.height / edge, image.channels);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      for (int c = 0; c < image.channels; ++c)
        mean.at(x / edge, y / edge)[c] += image.at(x, y)[c] / static_cast<float>(edge * edge);
  return mean;
}

TEST_F(GpuDrawing, FramesOfMeshAtRestHaveSmoothEdges) {
  constexpr int kEdge = 4;
  const MeshPlace mesh;
  const auto stream = std::make_shared<GpuStream>(context_);
  GpuRendererSettings settings;
  settings.draw.exact = false;
  settings.selection.maximumScreenSpaceError = 0;  // the same contents at all sizes
  GpuSceneRenderer gpu(stream, makeGpuMeshDrawer(stream), {mesh.frame, mesh.tree, mesh.source(), {}}, settings);
  const Camera camera = flightCamera(), fine = camera.scaledTo(kEdge * camera.width, kEdge * camera.height);
  const ImageF expected = shrink(gpu.render(fine, flightPose(0), nullptr).colour, kEdge);
  const ImageF rough = gpu.render(camera, flightPose(0), nullptr).colour;
  do gpu.draw(camera, flightPose(0));
  while (gpu.hasMore());
  const ImageF smooth = gpu.lastImage().colour;
  // At edges the middle of a pixel has another colour than the whole of it.
  int edges = 0;
  double ofRough = 0, ofSmooth = 0;
  for (size_t i = 0; i < expected.pixels.size(); ++i) {
    const float difference = std::abs(rough.pixels[i] - expected.pixels[i]);
    if (difference < 0.1f) continue;
    ++edges;
    ofRough += difference;
    ofSmooth += std::abs(smooth.pixels[i] - expected.pixels[i]);
  }
  EXPECT_GT(edges, 30);
  EXPECT_LT(ofSmooth, 0.5 * ofRough);
}

TEST_F(GpuDrawing, ContentsOfMeshFadeIntoEachOtherPixelByPixel) {
  const MeshPlace mesh;
  constexpr float kShare = 0.25f;
  // Each image is the first of its drawer, so that all have the same thresholds.
  const auto draw = [&](const std::vector<std::pair<int, std::pair<float, float>>>& contents) {
    const auto stream = std::make_shared<GpuStream>(context_);
    const auto drawer = makeGpuMeshDrawer(stream, {.blends = false});
    GpuFrame frame(stream);
    std::vector<std::unique_ptr<GpuContent>> uploaded;
    SceneView<GpuContent> view{mesh.frame, {}, nullptr, nullptr};
    for (const auto& [tile, share] : contents) {
      uploaded.push_back(drawer->upload(*makeContent(MeshContent(mesh.contents[tile]))));
      view.frontToBack.emplace_back(uploaded.back().get()).share = share;
    }
    const Camera camera = flightCamera();
    const Pose pose = flightPose(0);
    DrawSettings settings;
    settings.exact = false;
    drawer->draw(frame, view, {camera, pose}, settings);
    return frame.drawn();
  };
  const RenderedView first = draw({{0, {0, 1}}});
  // The same content has other layers if it is the second one, hence both are there.
  const RenderedView both = draw({{0, {0, kShare}}, {1, {kShare, 1}}}), second = draw({{0, {0, 0}}, {1, {0, 1}}});
  int ofFirst = 0, ofSecond = 0;
  for (size_t i = 0; i < first.depth.pixels.size(); ++i) {
    const float depth = both.depth.pixels[i];
    if (first.depth.pixels[i] == second.depth.pixels[i]) continue;
    if (depth == first.depth.pixels[i])
      ++ofFirst;
    else if (depth == second.depth.pixels[i])
      ++ofSecond;
    else
      ADD_FAILURE() << "pixel " << i << " shows neither content";
  }
  EXPECT_GT(ofFirst + ofSecond, 500);
  EXPECT_NEAR(ofFirst / static_cast<double>(ofFirst + ofSecond), kShare, 0.06);
}

TEST_F(GpuDrawing, FramesOfMeshAreTheSameIfFragmentsAreDecoded) {
  const MeshPlace mesh;
  GpuRendererSettings settings;
  settings.draw.exact = false;
  const auto drawFrame = [&](bool decodesFragments) {
    const auto stream = std::make_shared<GpuStream>(context_);
    GpuMeshSettings drawing;
    drawing.decodesFragments = decodesFragments;
    GpuSceneRenderer gpu(stream, makeGpuMeshDrawer(stream, drawing), {mesh.frame, mesh.tree, mesh.source(), {}},
                         settings);
    gpu.draw(flightCamera(), flightPose(200));
    return gpu.lastImage();
  };
  const RenderedView once = drawFrame(false), everywhere = drawFrame(true);
  EXPECT_GT(decibels(everywhere.colour, once.colour), 55);
  for (size_t i = 0; i < once.depth.pixels.size(); ++i)
    ASSERT_NEAR(everywhere.depth.pixels[i], once.depth.pixels[i], 1e-3f * (1 + once.depth.pixels[i])) << i;
}

TEST_F(GpuDrawing, ReadsContentsInTheBackgroundUntilTheImageEqualsTheBlockingOne) {
  GpuRendererSettings settings;
  settings.selection.maximumScreenSpaceError = 0.5;
  GpuSceneRenderer waits = onGpu(place(), settings);
  const RenderedView expected = waits.render(flightCamera(), flightPose(0), nullptr);
  settings.inBackground = true;
  GpuSceneRenderer gpu = onGpu(place(), settings);
  gpu.draw(flightCamera(), flightPose(0));
  const size_t missing = gpu.state().missing;
  EXPECT_GT(missing, 0u);  // coarser contents are drawn in their place
  for (int i = 0; i < 5000 && gpu.state().missing > 0; ++i) {
    const size_t before = gpu.state().missing;
    if (!gpu.hasMore()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      continue;
    }
    gpu.draw(flightCamera(), flightPose(0));
    EXPECT_EQ(gpu.state().missing, before - 1);  // one at a time: no frame waits for several
  }
  ASSERT_EQ(gpu.state().missing, 0u);
  EXPECT_EQ(gpu.state().cache.loads, waits.state().cache.loads);
  const RenderedView actual = gpu.render(flightCamera(), flightPose(0), nullptr);
  EXPECT_EQ(actual.colour.pixels, expected.colour.pixels);
  for (const auto& [x, y] : {std::pair(0, 0), std::pair(31, 20), std::pair(63, 30)}) {
    const GpuViewRenderer::Pixel pixel = gpu.pixelAt(x, y);
    EXPECT_EQ(pixel.opacity, *expected.opacity.at(x, y));
    EXPECT_EQ(pixel.depth, *expected.depth.at(x, y));
  }
}

TEST_F(GpuDrawing, CanBeDestroyedWhileTheGpuStillDraws) {
  const HashPlace hashPlace(32);
  for (int i = 0; i < 3; ++i) {
    GpuSceneRenderer gpu = onGpu(hashPlace, {});
    gpu.draw(flightCamera().scaledTo(300, 200), flightPose(100 * i));
  }
}

TEST_F(GpuDrawing, FollowsCamerasOfOtherSizes) {
  GpuSceneRenderer gpu = onGpu(place(), {});
  EXPECT_EQ(gpu.render(flightCamera(), flightPose(0), nullptr).colour.width, 64);
  EXPECT_EQ(gpu.render(flightCamera().scaledTo(20, 11), flightPose(0), nullptr).opacity.pixels.size(), 220u);
}

}  // namespace
}  // namespace tessera
