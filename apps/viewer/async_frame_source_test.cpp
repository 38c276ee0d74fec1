#include "apps/viewer/async_frame_source.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>

#include "base/error.h"
#include "gpu/testing/test_context.h"

namespace tessera {
namespace {

using std::chrono::milliseconds;

constexpr int kPictureWidth = 64, kPictureHeight = 48;

// Renders a plane at depth 2 · x, whose colour encodes the rendered version and position.
class FakeRenderer final : public ChangingRenderer, public ViewRenderer {
 public:
  struct Control {
    std::atomic<int> version = 1, slowness = 0;  // milliseconds per image
    std::atomic<int> pictures = 0;
    std::atomic<bool> fails = false;
  };
  explicit FakeRenderer(Control& control) : control_(control), drawn_(control.version) {}

  bool refresh() override {
    if (control_.fails) throw Error("model", "", "is gone", "bring it back");
    return std::exchange(drawn_, control_.version) != drawn_;
  }
  ViewRenderer& renderer() override { return *this; }
  FrameSource::Facts facts() const override { return {{"Version", std::to_string(drawn_)}}; }
  std::string device() const override { return "fake"; }
  RenderedView render(const Camera& camera, const Pose& pose, const ImageF*) override {
    ++control_.pictures;
    std::this_thread::sleep_for(milliseconds(control_.slowness));
    RenderedView view{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                      ImageF(camera.width, camera.height, 1)};
    for (size_t p = 0; p < view.opacity.pixels.size(); ++p) {
      view.opacity.pixels[p] = pose.translation.x() > 0 ? 1.0f : 0.25f;
      view.depth.pixels[p] = view.opacity.pixels[p] * 2 * static_cast<float>(pose.translation.x());
    }
    return view;
  }

 private:
  Control& control_;
  int drawn_;
};

class AsyncFrameSourceTest : public testing::Test {
 protected:
  void SetUp() override {
    GpuOptions options;
    options.validation = true;
    context_ = openForTest(options);
    SKIP_WITHOUT_VULKAN(context_);
    pictures_ = std::make_unique<AsyncFrameSource>(context_, std::make_unique<FakeRenderer>(control_));
  }
  void TearDown() override {
    pictures_.reset();
    if (context_) {
      EXPECT_EQ(GpuContext::validationMessages(), 0);
    }
  }

  static Camera window() {
    return {kPictureWidth, kPictureHeight, LensModel::pinhole, {50, 50, 0.5 * kPictureWidth, 0.5 * kPictureHeight}};
  }
  static Pose poseAt(double x) {
    Pose pose;
    pose.translation.x() = x;
    return pose;
  }
  ShownPicture update(double x, bool moving = false) { return pictures_->update(window(), poseAt(x), moving); }
  // Requests a view until its image is complete; returns false on a timeout.
  bool becomesWhole(double x) {
    for (int i = 0; i < 5000; ++i) {
      if (update(x).isComplete) return true;
      std::this_thread::sleep_for(milliseconds(1));
    }
    return false;
  }

  FakeRenderer::Control control_;
  std::shared_ptr<GpuContext> context_;
  std::unique_ptr<AsyncFrameSource> pictures_;
};

TEST_F(AsyncFrameSourceTest, ShowsFewPixelsFirstAndThenAllOfThem) {
  EXPECT_EQ(update(1).onGpu.colour, 0u);  // there is no image yet, and the call does not block
  int first = 0;
  for (int i = 0; i < 5000 && first == 0; ++i) {
    first = update(1).onGpu.width;
    std::this_thread::sleep_for(milliseconds(1));
  }
  EXPECT_LE(first, kPictureWidth);
  ASSERT_TRUE(becomesWhole(1));
  EXPECT_EQ(update(1).onGpu.width, kPictureWidth);
  EXPECT_FALSE(update(1).isNew);
}

TEST_F(AsyncFrameSourceTest, IsIncompleteForANewViewUntilItIsDrawn) {
  ASSERT_TRUE(becomesWhole(1));
  EXPECT_FALSE(update(2).isComplete);
  EXPECT_FALSE(update(3).isComplete);
  ASSERT_TRUE(becomesWhole(3));
  const std::optional<Vec3d> place = pictures_->placeAt(0.5, 0.5);
  ASSERT_TRUE(place.has_value());
  EXPECT_NEAR(place->z(), 6, 1e-5);  // of the third view
  EXPECT_NEAR(place->x(), 3, 0.2);
  EXPECT_FALSE(update(3, true).isComplete);  // no image is complete while the camera moves
}

TEST_F(AsyncFrameSourceTest, ReturnsNoPlaceWhereAPixelIsMostlyTransparent) {
  ASSERT_TRUE(becomesWhole(-1));
  EXPECT_FALSE(pictures_->placeAt(0.5, 0.5).has_value());
}

TEST_F(AsyncFrameSourceTest, RedrawsWhenTheRendererHasChanged) {
  ASSERT_TRUE(becomesWhole(1));
  const int before = control_.pictures;
  control_.version = 2;
  for (int i = 0; i < 5000 && control_.pictures == before; ++i) std::this_thread::sleep_for(milliseconds(1));
  EXPECT_GT(control_.pictures, before);
  for (int i = 0; i < 5000 && pictures_->facts()[0].second != "2"; ++i) {
    update(1);
    std::this_thread::sleep_for(milliseconds(1));
  }
  EXPECT_EQ(pictures_->facts()[0].second, "2");
}

TEST_F(AsyncFrameSourceTest, AbandonsAnImageWhenAnotherViewIsRequested) {
  ASSERT_TRUE(becomesWhole(1));
  control_.slowness = 150;  // for each band; bands then have one row
  update(2);
  std::this_thread::sleep_for(milliseconds(400));
  const auto begun = std::chrono::steady_clock::now();
  int seen = 0;
  for (int i = 0; i < 3000 && seen == 0; ++i) {  // before all rows of the second view are drawn
    const ShownPicture picture = update(3);
    if (picture.isNew) {
      const std::optional<Vec3d> place = pictures_->placeAt(0.5, 0.5);
      if (place && std::abs(place->z() - 6) < 1e-4) seen = 1;
    }
    std::this_thread::sleep_for(milliseconds(2));
  }
  EXPECT_EQ(seen, 1);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(4));  // all rows would take 7 seconds
  control_.slowness = 0;
}

TEST_F(AsyncFrameSourceTest, RethrowsErrorsOfTheDrawingThread) {
  ASSERT_TRUE(becomesWhole(1));
  control_.fails = true;
  EXPECT_THROW(
      {
        for (int i = 0; i < 5000; ++i) {
          update(1);
          std::this_thread::sleep_for(milliseconds(1));
        }
      },
      Error);
}

}  // namespace
}  // namespace tessera
