// Tests the calls that the renderer makes to its drawer. tests/gpu_drawing_test.cpp compares its images with
// those of the CPU.
#include "render/vulkan/gpu_scene_renderer.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "gpu/testing/test_context.h"
#include "render/testing/numbered_contents.h"

namespace tessera {
namespace {

struct Asked {
  int uploaded = 0;
  std::vector<int> drawn;  // tiles of the last image, in the order in which they were passed
  DrawSettings settings;
  bool wantsAnotherFrame = false;
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
  std::unique_ptr<GpuContent> upload(const Content& content) override {
    ++asked_->uploaded;
    return std::make_unique<NumberedGpuContent>(static_cast<const NumberedContent&>(content).tile);
  }
  void draw(GpuFrame& frame, const SceneView<GpuContent>& view, const ViewRequest& request,
            const DrawSettings& settings) override {
    asked_->drawn.clear();
    for (const DrawnContent<GpuContent>& drawn : view.frontToBack) {
      asked_->drawn.push_back(static_cast<const NumberedGpuContent&>(*drawn.content).tile);
    }
    asked_->settings = settings;
    frame.begin(view.frame, settings.minTransmittance, 4, request);
  }
  bool wantsAnotherFrame() const override { return asked_->wantsAnotherFrame; }

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

TEST_F(GpuSceneRendererCalls, ReportMoreToShowWhereTheDrawerWantsAnotherFrame) {
  GpuSceneRenderer renderer = rendererWith(within(kAll));
  renderer.render(place_.camera(), place_.above(), nullptr);
  EXPECT_FALSE(renderer.hasMore());
  asked_.wantsAnotherFrame = true;
  EXPECT_TRUE(renderer.hasMore());
}

}  // namespace
}  // namespace tessera
