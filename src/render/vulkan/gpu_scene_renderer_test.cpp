// Tests the calls that the renderer makes to its drawer. tests/gpu_drawing_test.cpp compares its images with
// those of the CPU.
#include "render/vulkan/gpu_scene_renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

#include "gpu/testing/test_context.h"
#include "render/testing/numbered_contents.h"

namespace tessera {
namespace {

struct Asked {
  int uploaded = 0;
  std::vector<int> drawn;                       // tiles of the last image, in the order in which they were passed
  std::vector<std::pair<float, float>> shares;  // of the pixels, of each of them
  DrawSettings settings;
  bool wantsAnotherFrame = false, crossFades = false;
  std::atomic<int> prepared = 0;
};

struct NumberedGpuContent final : GpuContent {
  explicit NumberedGpuContent(int tile) : tile(tile) {}
  uint64_t memoryBytes() const override { return 3 * NumberedPlace::kContentBytes; }
  int tile;
};

class AskedDrawer final : public GpuDrawer {
 public:
  explicit AskedDrawer(Asked* asked) : asked_(asked) {}

  uint64_t residentBytes(uint64_t decodedBytes) const override { return 3 * decodedBytes; }
  uint64_t residentBytesOfResource(uint64_t decodedBytes) const override { return 2 * decodedBytes; }
  std::unique_ptr<Content> prepare(std::unique_ptr<Content> content) const override {
    ++asked_->prepared;
    static_cast<NumberedContent&>(*content).prepared = true;
    return content;
  }
  std::unique_ptr<GpuContent> upload(const Content& content) override {
    EXPECT_TRUE(static_cast<const NumberedContent&>(content).prepared);
    ++asked_->uploaded;
    return std::make_unique<NumberedGpuContent>(static_cast<const NumberedContent&>(content).tile);
  }
  void draw(GpuFrame& frame, const SceneView<GpuContent>& view, const ViewRequest& request,
            const DrawSettings& settings) override {
    asked_->drawn.clear();
    asked_->shares.clear();
    for (const DrawnContent<GpuContent>& drawn : view.frontToBack) {
      asked_->shares.push_back(drawn.share);
      asked_->drawn.push_back(static_cast<const NumberedGpuContent&>(*drawn.content).tile);
    }
    asked_->settings = settings;
    frame.begin(view.frame, settings.minTransmittance, 4, request);
  }
  bool wantsAnotherFrame() const override { return asked_->wantsAnotherFrame; }
  bool crossFades() const override { return asked_->crossFades; }

 private:
  Asked* asked_;
};

class GpuSceneRendererCalls : public testing::Test {
 protected:
  static constexpr uint64_t kAll = 5 * 3 * NumberedPlace::kContentBytes + 2 * NumberedPlace::kResourceBytes;

  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
  }
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }

  GpuSceneRenderer rendererWith(const GpuRendererSettings& settings) {
    return {std::make_shared<GpuStream>(context_),
            std::make_unique<AskedDrawer>(&asked_),
            {place_.frame, place_.tree, place_.source(), {}},
            settings};
  }
  static GpuRendererSettings within(uint64_t budgetBytes) {
    GpuRendererSettings settings;
    settings.budgetBytes = budgetBytes;
    settings.selection.maximumScreenSpaceError = 0;  // the finest available
    return settings;
  }

  const NumberedPlace place_;
  Asked asked_;
  std::shared_ptr<GpuContext> context_;
};

TEST_F(GpuSceneRendererCalls, UploadEachContentOnceAndCountWhatItAndItsResourcesTake) {
  GpuSceneRenderer renderer = rendererWith(within(kAll));
  for (int picture = 0; picture < 2; ++picture) renderer.render(place_.camera(), place_.above(), nullptr);
  std::sort(asked_.drawn.begin(), asked_.drawn.end());
  EXPECT_EQ(asked_.drawn, (std::vector<int>{1, 2, 3, 4}));
  EXPECT_EQ(asked_.uploaded, 5);
  EXPECT_EQ(renderer.cache().statistics().bytes, kAll);
  GpuSceneRenderer few = rendererWith(within(kAll - 1));
  few.render(place_.camera(), place_.above(), nullptr);
  EXPECT_EQ(std::count(asked_.drawn.begin(), asked_.drawn.end(), 0), 1) << "a byte less, and the root stands for one";
}

TEST_F(GpuSceneRendererCalls, AskForExactPicturesAlwaysInRenderAndByTheSettingsInDraw) {
  for (const bool exact : {false, true}) {
    GpuRendererSettings settings = within(kAll);
    settings.draw = {0.25f, {}, exact};
    GpuSceneRenderer renderer = rendererWith(settings);
    renderer.render(place_.camera(), place_.above(), nullptr);
    EXPECT_TRUE(asked_.settings.exact);
    EXPECT_EQ(asked_.settings.minTransmittance, 0.25f);
    renderer.draw(place_.camera(), place_.above());
    EXPECT_EQ(asked_.settings.exact, exact);
  }
}

TEST_F(GpuSceneRendererCalls, PrepareEachContentBeforeItsUpload) {
  GpuRendererSettings settings = within(kAll);
  for (const bool inBackground : {false, true}) {
    settings.inBackground = inBackground;
    asked_.prepared = asked_.uploaded = 0;
    GpuSceneRenderer renderer = rendererWith(settings);
    for (int i = 0; i < 5000 && asked_.uploaded < 5; ++i) {
      renderer.draw(place_.camera(), place_.above());
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_EQ(asked_.uploaded, 5);
    EXPECT_EQ(asked_.prepared, 5);
  }
}

TEST_F(GpuSceneRendererCalls, FadeBetweenLevelsInFramesThatNeedNotBeExact) {
  GpuRendererSettings settings = within(kAll);
  settings.draw.exact = false;
  Pose high = place_.above();
  high.translation.z() = 1000;  // where the root is drawn
  const std::pair<float, float> everywhere = {0, 1};
  for (const bool crossFades : {false, true}) {
    asked_.crossFades = crossFades;
    settings.selection.maximumScreenSpaceError = 0.01;
    GpuSceneRenderer renderer = rendererWith(settings);
    renderer.draw(place_.camera(), high);
    ASSERT_EQ(asked_.drawn, std::vector<int>{0});
    EXPECT_FALSE(renderer.hasMore());
    renderer.draw(place_.camera(), place_.above());
    EXPECT_EQ(asked_.drawn.size(), crossFades ? 8u : 4u);
    EXPECT_EQ(renderer.hasMore(), crossFades);
    for (const auto& share : asked_.shares) EXPECT_EQ(share == everywhere, !crossFades);
    renderer.render(place_.camera(), place_.above(), nullptr);
    EXPECT_EQ(asked_.drawn.size(), 4u) << "exact images have no history";
    EXPECT_FALSE(renderer.hasMore());
  }
}

TEST_F(GpuSceneRendererCalls, ReportMoreToShowWhereTheDrawerWantsAnotherFrame) {
  GpuSceneRenderer renderer = rendererWith(within(kAll));
  renderer.render(place_.camera(), place_.above(), nullptr);
  EXPECT_FALSE(renderer.hasMore());
  asked_.wantsAnotherFrame = true;
  EXPECT_TRUE(renderer.hasMore());
}

}  // namespace
}  // namespace tessera
