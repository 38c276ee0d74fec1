#include "apps/viewer/viewer.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "apps/viewer/testing/test_screen.h"
#include "apps/viewer/window.h"
#include "base/error.h"
#include "base/image_io.h"
#include "base/testing/temporary_folder.h"
#include "eval/psnr.h"
#include "gpu/presenter.h"
#include "gpu/testing/test_context.h"
#include "representations/gpu_world.h"
#include "world/testing/test_models.h"

namespace tessera {
namespace {

constexpr int kWidth = 320, kHeight = 240;

class ViewerTest : public testing::Test {
 protected:
  void SetUp() override {
    setenv("TESSERA_VULKAN_VALIDATION", "1", 0);
    SKIP_WITHOUT_VULKAN(openForTest());
    if (!screen_.isThere()) {
      if (vulkanIsRequired()) FAIL() << "no virtual screen: install xvfb";
      GTEST_SKIP() << "no virtual screen is installed (xvfb has one)";
    }
  }

  // Returns what the window shows of a golden scene once the image is complete.
  ImageU8 shown(const std::string& representation, const std::string& device, bool panels = false, int scale = 1) {
    ViewOptions view;
    view.folder = fs::path(TESSERA_GOLDEN_SCENES) / representation;
    view.device = {device, 2};
    view.maximumScreenSpaceError = 0;
    WindowOptions window;
    window.width = scale * kWidth;
    window.height = scale * kHeight;
    window.panels = panels;
    window.screenshot = folder_ / "shown.png";
    runViewer(view, window);
    return readImage(window.screenshot).image;
  }

  // Renders the same view on the CPU, without a window.
  static ImageF requested(const std::string& representation) {
    const fs::path folder = fs::path(TESSERA_GOLDEN_SCENES) / representation;
    const std::unique_ptr<Device> cpu = makeDevice({"cpu", 2});
    const std::unique_ptr<RenderSource> renderSource = openRenderSource(*cpu, folder, {2});
    ViewOptions view;
    view.folder = folder;
    const Place place = loadPlace(view, std::nullopt);
    const double focal = 0.5 * kHeight / std::tan(25 * std::numbers::pi / 180);
    const Camera camera = {kWidth, kHeight, LensModel::pinhole, {focal, focal, 0.5 * kWidth, 0.5 * kHeight}};
    const Pose pose = Navigation(place.low, place.high).worldFromCamera();
    // Quantised to bytes, because the golden scenes' colours exceed the displayable range.
    return toFloat(
        toBytes(compositeOver(renderSource->renderer().render(camera, pose), renderSource->renderer().background())));
  }

  TemporaryFolder folder_;

 private:
  TestScreen screen_;
};

TEST_F(ViewerTest, ShowsScenesThatItsDeviceDrawsAsTheCpuDoes) {
  for (const char* representation : {"volume", "hash"}) {
    const ImageF oracle = requested(representation);
    EXPECT_GT(psnr(toFloat(shown(representation, "vulkan")), oracle), 45) << representation;
  }
  EXPECT_EQ(GpuContext::validationMessages(), 0);
}

TEST_F(ViewerTest, ShowsWhatAnotherDeviceDraws) {
  EXPECT_GT(psnr(toFloat(shown("volume", "cpu")), requested("volume")), 50);
  // Also if images arrive long after the window has come to rest.
  EXPECT_EQ(shown("volume", "cpu", false, 4).width, 4 * kWidth);
  EXPECT_EQ(GpuContext::validationMessages(), 0);
}

TEST_F(ViewerTest, ShowsMeshScenesAsTheCpuDrawsThem) {
  const ImageF oracle = requested("mesh");
  const auto [least, most] = std::minmax_element(oracle.pixels.begin(), oracle.pixels.end());
  EXPECT_GT(*most - *least, 0.3f) << "the view shows something";
  EXPECT_GT(psnr(toFloat(shown("mesh", "cpu")), oracle), 50);
  // The mean of 64 frames, in which many layers of this scene are half transparent.
  EXPECT_GT(psnr(toFloat(shown("mesh", "vulkan")), oracle), 34);
  EXPECT_EQ(GpuContext::validationMessages(), 0);
}

TEST_F(ViewerTest, ShowsAWorldWithItsModelsFromABookmark) {
  fs::create_directory_symlink(fs::path(TESSERA_GOLDEN_SCENES) / "volume", folder_ / "volume");
  writeFileAtomically(folder_ / "box.glb", std::string_view(testGlb({10, 10, 10}, "1, 0, 0, 1")));
  const std::string text = R"({"kind": "tessera world", "version": 2, "scenes": [{"url": "volume"}],
    "models": [{"name": "box", "files": ["box.glb"], "position": [0, -45, 8], "rotation": [0, 0, 0, 1],
                "scale": [1, 1, 1]}],
    "bookmarks": [{"name": "From the south", "view": "eye=10,-120,70&target=10,-20,5&fov=50"}]})";
  writeFileAtomically(folder_ / "world.json", std::string_view(text));
  ViewOptions view;
  view.folder = folder_.path();
  view.maximumScreenSpaceError = 0;
  WindowOptions window;
  window.width = kWidth;
  window.height = kHeight;
  window.panels = false;
  window.from = "south";
  window.screenshot = folder_ / "shown.png";
  runViewer(view, window);
  const ImageU8 seen = readImage(window.screenshot).image;
  const std::optional<WorldToView> read = readWorldToView(view);
  const Place place = loadPlace(view, read);
  ASSERT_EQ(place.views.size(), 1u);
  GpuRendererSettings settings;
  settings.selection.maximumScreenSpaceError = 0;
  const auto world = openGpuWorld(openForTest(), read->world, read->file, settings);
  const double focal = 0.5 * kHeight / std::tan(25 * std::numbers::pi / 180);
  const Camera camera = {kWidth, kHeight, LensModel::pinhole, {focal, focal, 0.5 * kWidth, 0.5 * kHeight}};
  const ImageU8 expected =
      toBytes(compositeOver(world->render(camera, place.views[0].worldFromCamera), world->background()));
  EXPECT_GT(psnr(toFloat(seen), toFloat(expected)), 40);
  size_t red = 0;
  for (size_t p = 0; p < seen.pixelCount(); ++p)
    red += seen.pixels[3 * p] > 150 && seen.pixels[3 * p + 1] < 100 ? 1 : 0;
  EXPECT_GT(red, 300u);
  view.device = {"cpu", 2};
  EXPECT_THROW(runViewer(view, window), Error);
  EXPECT_EQ(GpuContext::validationMessages(), 0);
}

TEST_F(ViewerTest, LaysThePanelOverThePicture) {
  const ImageU8 without = shown("volume", "vulkan"), with = shown("volume", "vulkan", true);
  size_t left = 0, right = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const size_t p = 3 * (static_cast<size_t>(y) * kWidth + static_cast<size_t>(x));
      const bool differs = std::abs(with.pixels[p] - without.pixels[p]) > 8;
      (x < 5 || y < 5 ? left : right) += differs;
    }
  }
  EXPECT_EQ(left, 0u);  // beside the panel
  EXPECT_GT(right, 5000u);
  EXPECT_EQ(GpuContext::validationMessages(), 0);
}

TEST_F(ViewerTest, FollowsTheWindowsSize) {
  Window window("resized", 200, 100);
  window.show();
  GpuOptions options;
  options.presents = true;
  const std::shared_ptr<GpuContext> context = GpuContext::open(options);
  GpuPresenter presenter(context, window.makeSurface(context->instance()));
  for (const auto& [width, height] : {std::pair(200, 100), std::pair(320, 240), std::pair(120, 90)}) {
    glfwSetWindowSize(window.handle(), width, height);
    ImageU8 seen;
    for (int i = 0; i < 200 && (seen.width != width || seen.height != height); ++i) {
      window.listen(0.01);
      if (presenter.begin(window.pixels())) presenter.end(&seen);
    }
    EXPECT_EQ(seen.width, width);
    EXPECT_EQ(seen.height, height);
    for (const uint8_t value : seen.pixels) ASSERT_EQ(value, 0);
  }
  EXPECT_FALSE(presenter.begin({0, 0}));
  EXPECT_TRUE(presenter.begin(window.pixels()));
  presenter.end();
  EXPECT_EQ(GpuContext::validationMessages(), 0);
}

TEST_F(ViewerTest, NamesWhatItCannotShow) {
  ViewOptions view;
  view.folder = folder_ / "nothing";
  try {
    runViewer(view, {});
    FAIL() << "shown";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("there is no such folder"), std::string::npos) << error.what();
  }
  fs::create_directories(view.folder);
  EXPECT_THROW(runViewer(view, {}), Error);
}

}  // namespace
}  // namespace tessera
