// Tests the calls that the renderer makes to its drawer.
#include "render/cpu/scene_renderer.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "base/error.h"
#include "render/testing/numbered_contents.h"

namespace tessera {
namespace {

// Records the calls to a drawer.
struct Asked {
  int prepared = 0, preparingThreads = -1;
  std::vector<int> drawn;  // tiles of the last image, in the order in which they were passed
  bool allWerePrepared = true;
  int pinned = -1;
  DrawSettings settings;
  const ImageF* opaqueDepth = nullptr;
};

// Prepared contents take three times their decoded memory, and resources twice theirs.
class AskedDrawer final : public CpuDrawer {
 public:
  explicit AskedDrawer(Asked* asked, uint64_t preparedBytes) : asked_(asked), preparedBytes_(preparedBytes) {}

  uint64_t residentBytes(uint64_t decodedBytes) const override { return 3 * decodedBytes; }
  uint64_t residentBytesOfResource(uint64_t decodedBytes) const override { return 2 * decodedBytes; }
  std::unique_ptr<Content> prepare(std::unique_ptr<Content> content, int threads) const override {
    auto& numbered = static_cast<NumberedContent&>(*content);
    EXPECT_FALSE(numbered.prepared);
    numbered.prepared = true;
    numbered.bytes = preparedBytes_;
    ++asked_->prepared;
    asked_->preparingThreads = threads;
    return content;
  }
  RenderedView draw(const SceneView<Content>& view, const ViewRequest& request, const DrawSettings& settings,
                    ThreadPool&, DrawCounts& counts) override {
    asked_->drawn.clear();
    for (const DrawnContent<Content>& drawn : view.frontToBack) {
      const auto& content = static_cast<const NumberedContent&>(*drawn.content);
      asked_->drawn.push_back(content.tile);
      asked_->allWerePrepared &= content.prepared;
    }
    asked_->pinned = static_cast<const NumberedContent&>(*view.pinned).tile;
    asked_->settings = settings;
    asked_->opaqueDepth = request.opaqueDepth;
    counts.steps += 5;
    return {};
  }
  std::vector<std::string_view> skippingModes() const override { return {"fast", "none"}; }

 private:
  Asked* asked_;
  uint64_t preparedBytes_;
};

class SceneRendererTest : public testing::Test {
 protected:
  static constexpr uint64_t kPrepared = 3 * NumberedPlace::kContentBytes;
  static constexpr uint64_t kResource = 2 * NumberedPlace::kResourceBytes;
  static constexpr uint64_t kAll = 5 * kPrepared + kResource;

  SceneRenderer rendererWith(const SceneRendererSettings& settings, uint64_t preparedBytes = kPrepared) {
    return {std::make_unique<AskedDrawer>(&asked_, preparedBytes), place_.frame, place_.tree, place_.source(),
            settings};
  }
  static SceneRendererSettings within(uint64_t budgetBytes) {
    SceneRendererSettings settings;
    settings.budgetBytes = budgetBytes;
    settings.selection.maximumScreenSpaceError = 0;  // the finest available
    return settings;
  }

  const NumberedPlace place_;
  Asked asked_;
};

TEST_F(SceneRendererTest, DrawsContentsThatItsDrawerHasPreparedOnce) {
  SceneRendererSettings settings = within(kAll);
  settings.threads = 3;
  SceneRenderer renderer = rendererWith(settings);
  EXPECT_EQ(asked_.preparingThreads, 3);
  EXPECT_EQ(asked_.prepared, 1) << "the root, which always is in memory";
  for (int picture = 0; picture < 2; ++picture) renderer.render(place_.camera(), place_.above(), nullptr);
  std::sort(asked_.drawn.begin(), asked_.drawn.end());
  EXPECT_EQ(asked_.drawn, (std::vector<int>{1, 2, 3, 4}));
  EXPECT_TRUE(asked_.allWerePrepared);
  EXPECT_EQ(asked_.prepared, 5);
  EXPECT_EQ(asked_.pinned, 0);
  EXPECT_EQ(renderer.drawCounts().steps, 10u);
}

TEST_F(SceneRendererTest, CountsWhatPreparedContentsAndTheirResourcesTake) {
  SceneRenderer all = rendererWith(within(kAll));
  all.render(place_.camera(), place_.above(), nullptr);
  EXPECT_EQ(all.cacheStatistics().bytes, kAll);
  SceneRenderer few = rendererWith(within(kAll - 1));
  few.render(place_.camera(), place_.above(), nullptr);
  EXPECT_EQ(std::count(asked_.drawn.begin(), asked_.drawn.end(), 0), 1) << "a byte less, and the root stands for one";
  EXPECT_LE(few.cacheStatistics().maxBytes, kAll - 1);
}

TEST_F(SceneRendererTest, RejectsAContentThatTakesMoreThanItsDrawerDeclared) {
  EXPECT_THROW(rendererWith(within(kAll), kPrepared + 1), Error);
}

TEST_F(SceneRendererTest, PassesRequestsToItsDrawer) {
  SceneRendererSettings settings = within(kAll);
  settings.draw = {0.25f, "none", false};
  SceneRenderer renderer = rendererWith(settings);
  const ImageF depth(place_.camera().width, place_.camera().height, 1, 2.0f);
  renderer.render(place_.camera(), place_.above(), &depth);
  EXPECT_EQ(asked_.settings.minTransmittance, 0.25f);
  EXPECT_EQ(asked_.settings.skipping, "none");
  EXPECT_FALSE(asked_.settings.exact);
  EXPECT_EQ(asked_.opaqueDepth, &depth);
}

}  // namespace
}  // namespace tessera
