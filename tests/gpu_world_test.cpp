// Tests that scenes of all representations, and models among them, hide one another correctly in a world that is drawn
// on the GPU.
#include "representations/gpu_world.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/error.h"
#include "base/testing/temporary_folder.h"
#include "gpu/testing/test_context.h"
#include "render/cpu/scene_renderer.h"
#include "render/tile_scene.h"
#include "representations/codecs.h"
#include "representations/cpu_drawers.h"
#include "representations/gpu_drawers.h"
#include "tiles/scene_folder.h"
#include "world/testing/test_models.h"

namespace tessera {
namespace {

// The golden scenes have the same frame: 25 m to a scene unit. Here they stand side by side.
const Vec3d kOrigin(10, -20, 5);
const char* const kNames[] = {"volume", "hash", "mesh"};
const Vec3d kShifts[] = {{0, 0, 0}, {110, 20, 0}, {-90, -20, 0}};

Camera camera() {
  return {160, 120, LensModel::pinhole, {110, 110, 80, 60}};
}

Pose lookAt(const Vec3d& eye, const Vec3d& target) {
  Pose pose;
  const Vec3d forward = (target - eye).normalized(), right = forward.cross(Vec3d::UnitZ()).normalized();
  pose.rotation << right, forward.cross(right), forward;
  pose.translation = eye;
  return pose;
}

// A box among the models of a world.
struct TestBox {
  Vec3d middle = Vec3d::Zero(), size = Vec3d::Ones();
};

std::string listModels(const std::vector<TestBox>& boxes) {
  std::string list;
  for (const TestBox& box : boxes) {
    list += fmt::format(R"({}{{"name": "box", "files": ["box.gltf"], "position": [{}, {}, {}], "rotation": [0, 0, 0, 1],
                           "scale": [{}, {}, {}]}})",
                        list.empty() ? "" : ", ", box.middle.x(), box.middle.y(), box.middle.z(), box.size.x(),
                        box.size.y(), box.size.z());
  }
  return list;
}

// Returns the z-depths of what a camera sees of boxes, infinite beside them.
ImageF depthOfBoxes(const std::vector<TestBox>& boxes, const Camera& camera, const Pose& pose) {
  ImageF depths(camera.width, camera.height, 1, INFINITY);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Vec3d inCamera = *camera.directionInCamera({x + 0.5, y + 0.5});
      const SceneRay ray = {pose.translation, pose.rotation * inCamera};
      for (const TestBox& box : boxes) {
        const RayRange range = clipToBox(ray, box.middle - box.size / 2, box.middle + box.size / 2, {0, 1e6});
        if (range.empty()) continue;
        *depths.at(x, y) = std::min(*depths.at(x, y), static_cast<float>(range.near * inCamera.z()));
      }
    }
  }
  return depths;
}

class GpuWorld : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
    for (const char* name : kNames) {
      fs::create_directory_symlink(fs::path(TESSERA_GOLDEN_SCENES) / name, folder_ / name);
    }
    // Red in any light.
    const std::string unlit = R"(, "extensions": {"KHR_materials_unlit": {}})";
    writeFileAtomically(folder_ / "box.gltf", std::string_view(testGltf({1, 1, 1}, "1, 0, 0, 1", unlit)));
  }
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }

  std::unique_ptr<WorldRenderer> open(const std::string& scenes, const std::string& more = "") {
    GpuRendererSettings settings;
    settings.selection.maximumScreenSpaceError = 0;
    settings.draw.exact = false;
    const fs::path file = folder_ / "world.json";
    const std::string text = R"({"kind": "tessera world", "version": 2, "scenes": [)" + scenes + "]" + more + "}";
    return openGpuWorld(context_, decodeWorld(text, file.string()), file, settings);
  }
  std::unique_ptr<WorldRenderer> openAll(const std::vector<TestBox>& boxes, const std::string& more = "") {
    std::string scenes;
    for (size_t i = 0; i < 3; ++i) {
      const Vec3d& shift = kShifts[i];
      scenes += fmt::format(R"({}{{"url": "{}")", i == 0 ? "" : ", ", kNames[i]);
      if (i > 0) scenes += fmt::format(R"(, "position": [{}, {}, {}])", shift.x(), shift.y(), shift.z());
      scenes += "}";
    }
    return open(scenes, R"(, "models": [)" + listModels(boxes) + "]" + more);
  }
  // Returns the image of a scene alone, by the renderer on the CPU.
  RenderedView onCpu(size_t number, const Pose& pose, const ImageF* opaqueDepth = nullptr) const {
    SceneRendererSettings settings;
    settings.selection.maximumScreenSpaceError = 0;
    Pose moved = pose;
    moved.translation -= kShifts[number];
    const Tileset tileset = readTileset(folder_ / kNames[number]);
    TileScene scene = openTileScene(folder_ / kNames[number], requireCodec(folder_ / kNames[number], tileset));
    SceneRenderer renderer(makeCpuDrawer(tileset.representation), scene.frame, std::move(scene.tree),
                           std::move(scene.source), settings);
    return renderer.render(camera(), moved, opaqueDepth);
  }

  TemporaryFolder folder_;
  std::shared_ptr<GpuContext> context_;
};

double meanDifference(const ImageF& a, const ImageF& b) {
  double sum = 0;
  for (size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(a.pixels[i] - b.pixels[i]);
  return sum / static_cast<double>(a.pixels.size());
}

// Ten boxes: at each scene one in front of a building, one in it and one behind it; and one high above.
std::vector<TestBox> tenBoxes() {
  std::vector<TestBox> boxes;
  for (const Vec3d& shift : kShifts) {
    const auto at = [&](double x, double y, double z) -> Vec3d {
      return kOrigin + shift + Vec3d(0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y, z);
    };
    boxes.push_back({at(-25, -16, 2), {6, 6, 8}});
    boxes.push_back({at(-25, 0, 0), {8, 8, 8}});
    boxes.push_back({at(-28, 20, -4), {9, 9, 12}});
  }
  boxes.push_back({kOrigin + Vec3d(0, 0, 40), {10, 10, 10}});
  return boxes;
}

TEST_F(GpuWorld, ShowsAndHidesModelsAmongScenesOfEveryRepresentationAsTheCpuDoes) {
  const std::vector<TestBox> boxes = tenBoxes();
  size_t visible = 0, hidden = 0;
  for (size_t number = 0; number < 3; ++number) {
    SCOPED_TRACE(kNames[number]);
    const Vec3d& shift = kShifts[number];
    std::vector<TestBox> moved = boxes;
    for (TestBox& box : moved) box.middle -= shift;
    const auto world =
        open(fmt::format(R"({{"url": "{}"}})", kNames[number]), R"(, "models": [)" + listModels(moved) + "]");
    for (const Vec3d& eye : {Vec3d(-10, -75, 40), Vec3d(80, -40, 25)}) {
      const Pose pose = lookAt(eye + shift, kOrigin + shift);
      const ImageF depths = depthOfBoxes(boxes, camera(), pose);
      const RenderedView scene = onCpu(number, pose, &depths);
      Pose own = pose;
      own.translation -= shift;
      const RenderedView drawn = world->render(camera(), own);
      size_t covered = 0, correct = 0;
      for (size_t p = 0; p < depths.pixels.size(); ++p) {
        if (!std::isfinite(depths.pixels[p])) continue;
        ++covered;
        const float transmittance = 1 - scene.opacity.pixels[p];
        (transmittance > 0.5f ? visible : hidden) += 1;
        float difference = 0;
        for (size_t c = 0; c < 3; ++c) {
          const float expected = scene.colour.pixels[3 * p + c] + (c == 0 ? transmittance : 0);
          difference = std::max(difference, std::abs(drawn.colour.pixels[3 * p + c] - expected));
        }
        correct += difference < 0.03f ? 1 : 0;
      }
      EXPECT_GT(static_cast<double>(correct), 0.99 * static_cast<double>(covered)) << covered;
    }
  }
  EXPECT_GT(visible, 1000u);
  EXPECT_GT(hidden, 500u);
}

TEST_F(GpuWorld, ShowsTheNearestSurfaceWhereScenesInterlock) {
  const char* shifted = R"("position": [4, 3, 3], "rotation": [0, 0, 0, 1], "scale": 1)";
  for (const auto& [first, second] :
       {std::pair("volume", "mesh"), std::pair("mesh", "hash"), std::pair("hash", "volume")}) {
    SCOPED_TRACE(std::string(first) + ", " + second);
    const Pose pose = lookAt({-10, -75, 40}, kOrigin);
    const auto surface = [&](const std::string& scenes) { return open(scenes)->render(camera(), pose).depth; };
    const std::string one = fmt::format(R"({{"url": "{}"}})", first),
                      two = fmt::format(R"({{"url": "{}", {}}})", second, shifted);
    // A scene that is placed needs a main one, which is invisible.
    const std::string invisible = fmt::format(R"({{"url": "{}", "visible": false}}, )", first);
    const ImageF a = surface(one), b = surface(invisible + two), both = surface(one + ", " + two);
    size_t places = 0, correct = 0, ofFirst = 0;
    for (size_t p = 0; p < both.pixels.size(); ++p) {
      const float depths[] = {a.pixels[p], b.pixels[p]};
      const auto [nearest, other] = std::minmax(depths[0], depths[1]);
      // Beyond both boxes, each scene makes room for the other.
      if (nearest <= 0 || other > 90) continue;
      ++places;
      ofFirst += depths[0] < depths[1] ? 1 : 0;
      correct += std::abs(both.pixels[p] - nearest) < 0.02f * nearest ? 1 : 0;
    }
    EXPECT_GT(ofFirst, places / 10);
    EXPECT_LT(ofFirst, places * 9 / 10);
    EXPECT_GT(places, 500u);
    EXPECT_GE(static_cast<double>(correct), 0.95 * static_cast<double>(places)) << places;
  }
}

TEST_F(GpuWorld, HasTenModelsAmongThreeScenes) {
  const std::vector<TestBox> boxes = tenBoxes();
  const Pose pose = lookAt({-30, -150, 80}, kOrigin);
  const RenderedView drawn = openAll(boxes)->render(camera(), pose), without = openAll({})->render(camera(), pose);
  const ImageF depths = depthOfBoxes(boxes, camera(), pose);
  size_t covered = 0, correct = 0, visible = 0, hidden = 0;
  for (size_t p = 0; p < depths.pixels.size(); ++p) {
    if (!std::isfinite(depths.pixels[p])) continue;
    ++covered;
    // The depth without models decides, except where it is as good as the same.
    const float scene = without.depth.pixels[p] > 0 ? without.depth.pixels[p] : INFINITY;
    const bool isVisible = depths.pixels[p] < scene;
    (isVisible ? visible : hidden) += 1;
    const float nearest = std::min(scene, depths.pixels[p]);
    correct += std::abs(drawn.depth.pixels[p] - nearest) < 0.02f * nearest ? 1 : 0;
  }
  EXPECT_GT(visible, 100u);
  EXPECT_GT(hidden, 50u);
  EXPECT_GE(static_cast<double>(correct), 0.99 * static_cast<double>(covered)) << covered;
}

TEST_F(GpuWorld, GivesFramesInMotionAsRender) {
  const auto world = openAll(tenBoxes());
  const Pose pose = lookAt({-30, -150, 80}, kOrigin);
  const RenderedView still = openAll(tenBoxes())->render(camera(), pose);
  world->draw(camera(), lookAt({0, -140, 60}, kOrigin));  // the camera moves on
  world->draw(camera(), pose);
  size_t places = 0, correct = 0;
  for (int y = 4; y < camera().height; y += 8) {
    for (int x = 4; x < camera().width; x += 8) {
      const float expected = *still.depth.at(x, y);
      if (expected <= 0 || expected > 400) continue;  // no surface, or one far behind
      ++places;
      correct += std::abs(world->pixelAt(x, y).depth - expected) < 0.02f * expected ? 1 : 0;
    }
  }
  EXPECT_GT(places, 100u);
  // In motion, half-transparent surfaces are dithered.
  EXPECT_GE(static_cast<double>(correct), 0.95 * static_cast<double>(places)) << places;
}

TEST_F(GpuWorld, DrawsAllScenesAfterAnImageThatFailed) {
  fs::copy(fs::path(TESSERA_GOLDEN_SCENES) / "mesh", folder_ / "copy", fs::copy_options::recursive);
  const std::string scenes = R"({"url": "volume"}, {"url": "copy", "position": [4, 3, 3]})";
  const Pose away = lookAt({-10, -75, 40}, {-10, -150, 40}), pose = lookAt({-10, -75, 40}, kOrigin);
  const RenderedView expected = open(scenes)->render(camera(), pose);
  const auto world = open(scenes);
  const RenderedView before = world->render(camera(), away);
  fs::rename(folder_ / "copy/tiles/L0", folder_ / "copy/tiles/lost");
  EXPECT_THROW(world->render(camera(), pose), Error);
  fs::rename(folder_ / "copy/tiles/lost", folder_ / "copy/tiles/L0");
  const RenderedView drawn = world->render(camera(), pose);
  EXPECT_GT(meanDifference(before.colour, expected.colour), 0.05);
  EXPECT_LT(meanDifference(drawn.colour, expected.colour), 1e-6);
}

TEST_F(GpuWorld, EndsItsWorkBeforeItIsDestroyed) {
  fs::copy(fs::path(TESSERA_GOLDEN_SCENES) / "volume", folder_ / "copy", fs::copy_options::recursive);
  GpuRendererSettings settings;
  settings.selection.maximumScreenSpaceError = 0;
  const auto stream = std::make_shared<GpuStream>(context_);
  const Tileset tileset = readTileset(folder_ / "copy");
  std::vector<WorldRenderer::Scene> scenes;
  scenes.push_back({std::make_unique<GpuSceneRenderer>(
                        stream, makeGpuDrawer("volume", stream),
                        openTileScene(folder_ / "copy", requireCodec(folder_ / "copy", tileset)), settings),
                    true});
  auto world = std::make_unique<WorldRenderer>(stream, std::move(scenes), nullptr, std::vector<HiddenBox>(),
                                               Eigen::Array3f::Zero());
  stream->finish();
  fs::remove_all(folder_ / "copy/tiles/L0");
  EXPECT_THROW(world->render(camera(), lookAt({-10, -75, 40}, kOrigin)), Error);
  const uint64_t sent = stream->batchesSent();
  world.reset();
  EXPECT_GT(stream->batchesSent(), sent);
}

TEST_F(GpuWorld, HasNoMemoryForBackgroundBlocksThatItDoesNotDraw) {
  for (const char* name : kNames) {
    SCOPED_TRACE(name);
    const auto bytes = [&](const std::string& scenes) { return open(scenes)->state().cache.bytes; };
    const std::string hidden = R"({"url": "volume", "visible": false}, )";
    const std::string placed = fmt::format(R"({{"url": "{}", "position": [1, 2, 3]}})", name);
    const std::string main = fmt::format(R"({{"url": "{}"}})", name);
    const uint64_t ofPlaced = bytes(hidden + placed), ofMain = bytes(main);
    EXPECT_GT(ofPlaced, 0u);
    EXPECT_LT(ofPlaced, ofMain);
    EXPECT_EQ(bytes(main + ", " + placed), ofMain + ofPlaced);
  }
}

TEST_F(GpuWorld, HidesTheInsideOfBoxesInEveryRepresentationButNoModels) {
  const std::vector<TestBox> boxes = {{kOrigin + Vec3d(-20, -10, 3), {6, 6, 6}}};
  const char* everything =
      R"(, "hidden": [{"name": "all", "middle": [10, -20, 5], "size": [1e6, 1e6, 1e6], "turn": 0.3}])";
  for (const char* name : kNames) {
    SCOPED_TRACE(name);
    const std::string scene = fmt::format(R"({{"url": "{}"}})", name),
                      models = R"(, "models": [)" + listModels(boxes) + "]";
    const Pose pose = lookAt({-10, -75, 40}, kOrigin);
    const RenderedView whole = open(scene, models)->render(camera(), pose);
    const RenderedView none = open(scene, models + everything)->render(camera(), pose);
    const ImageF depths = depthOfBoxes(boxes, camera(), pose);
    size_t drawn = 0;
    for (size_t p = 0; p < depths.pixels.size(); ++p) {
      // The box reaches 500 km far, and the background block farther.
      if (none.depth.pixels[p] > 0 && none.depth.pixels[p] < 1e5f) ++drawn;
    }
    const size_t expected = static_cast<size_t>(
        std::count_if(depths.pixels.begin(), depths.pixels.end(), [](float depth) { return std::isfinite(depth); }));
    EXPECT_NEAR(static_cast<double>(drawn), static_cast<double>(expected), 0.05 * static_cast<double>(expected));
    EXPECT_GT(meanDifference(whole.colour, none.colour), 0.05);
  }
}

TEST_F(GpuWorld, IsRefusedWithThePlaceOfWhatIsMissing) {
  const auto place = [&](const std::string& scenes, const std::string& more) -> std::string {
    try {
      open(scenes, more);
    } catch (const Error& error) {
      return error.place();
    }
    return "accepted";
  };
  EXPECT_EQ(place(R"({"url": "gone"})", ""), "scenes[0].url");
  EXPECT_EQ(place(R"({"url": "https://example.org/a"})", ""), "scenes[0].url");
  EXPECT_EQ(place(R"({"url": "volume", "visible": false})", ""), "scenes");
  const std::string rest = R"(, "position": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}])";
  EXPECT_EQ(place(R"({"url": "volume"})", R"(, "models": [{"name": "a", "files": ["https://a.org/a.glb"])" + rest),
            "models[0].files");
}

}  // namespace
}  // namespace tessera
