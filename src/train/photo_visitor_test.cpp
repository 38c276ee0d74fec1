#include "train/photo_visitor.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <utility>

#include "train/testing/test_support.h"

namespace tessera {
namespace {

class Recorder final : public PixelVisitor {
 public:
  struct Batch {
    std::string photo;
    SeenThrough through;
    size_t pixels;
  };
  void begin(const Photo& photo, const Camera&) override { photo_ = photo.name; }
  void visit(std::span<const float> pixels, SeenThrough through) override {
    batches.push_back({photo_, through, pixels.size() / 2});
    for (size_t i = 0; i < pixels.size(); i += 2) {
      const bool isNew = seen[{photo_, through}].emplace(pixels[i], pixels[i + 1]).second;
      EXPECT_TRUE(isNew) << "twice";
    }
  }

  std::vector<Batch> batches;
  std::map<std::pair<std::string, SeenThrough>, std::set<std::pair<float, float>>> seen;

 private:
  std::string photo_;
};

class PhotoVisitorTest : public testing::Test {
 protected:
  // Visits photos of 16×12 pixels that look at the zenith, so that no direction outside them is higher.
  Recorder visited(int stride, const PhotoVisitor::Margin& margin, uint32_t maxBatchPixels = 1000) {
    Recorder recorder;
    PhotoVisitor visitor(capture_, SceneFrame(), maxBatchPixels, recorder);
    visitor.visitAll(stride, margin, [&](int64_t done, int64_t all) { progress_.emplace_back(done, all); });
    return recorder;
  }

  const TemporaryFolder folder_;
  Capture capture_ = plainCapture(folder_.path(), 2);
  std::vector<std::pair<int64_t, int64_t>> progress_;
};

TEST_F(PhotoVisitorTest, VisitsEveryPixelOfEveryTrainingPhoto) {
  capture_.photos.push_back(capture_.photos[0]);
  capture_.photos.back().name = "held out";
  capture_.photos.back().split = Split::test;
  Recorder recorder = visited(1, {});
  ASSERT_EQ(recorder.seen.size(), 2u);
  for (const auto& [of, pixels] : recorder.seen) {
    EXPECT_EQ(of.second, SeenThrough::photo);
    EXPECT_EQ(pixels.size(), 16u * 12);
    EXPECT_TRUE((pixels.contains({0.5f, 0.5f})));
    EXPECT_TRUE((pixels.contains({15.5f, 11.5f})));
  }
  EXPECT_EQ(progress_, (std::vector<std::pair<int64_t, int64_t>>{{1, 2}, {2, 2}}));
}

TEST_F(PhotoVisitorTest, SkipsPixelsByItsStride) {
  Recorder recorder = visited(5, {});
  const auto& pixels = recorder.seen[{"photo_0.png", SeenThrough::photo}];
  EXPECT_EQ(pixels.size(), 4u * 3);
  EXPECT_TRUE((pixels.contains({5.5f, 10.5f})));
}

TEST_F(PhotoVisitorTest, SkipsMaskedPixels) {
  ImageU8 mask(16, 12, 1, 255);
  *mask.at(3, 4) = 0;
  capture_.photos[0].mask = folder_.path() / "mask.png";
  writePng(capture_.photos[0].mask, mask);
  Recorder recorder = visited(1, {});
  EXPECT_EQ((recorder.seen[{"photo_0.png", SeenThrough::photo}].size()), 16u * 12 - 1);
  EXPECT_FALSE((recorder.seen[{"photo_0.png", SeenThrough::photo}].contains({3.5f, 4.5f})));
  EXPECT_EQ((recorder.seen[{"photo_1.png", SeenThrough::photo}].size()), 16u * 12);
}

TEST_F(PhotoVisitorTest, LimitsTheSizeOfBatches) {
  const Recorder recorder = visited(1, {}, 100);
  std::vector<size_t> sizes;
  for (const Recorder::Batch& batch : recorder.batches) sizes.push_back(batch.pixels);
  EXPECT_EQ(sizes, (std::vector<size_t>{100, 92, 100, 92}));  // no batch contains pixels of two photos
}

TEST_F(PhotoVisitorTest, VisitsTheMargin) {
  Recorder beside = visited(1, {true, true}), everywhere = visited(1, {true, false});
  const auto& pixels = beside.seen[{"photo_0.png", SeenThrough::margin}];
  EXPECT_FALSE(pixels.empty());
  for (const auto& [x, y] : pixels) {
    EXPECT_TRUE(x < 0 || y < 0 || x > 16 || y > 12) << x << " " << y;
    EXPECT_TRUE(x > -8 && y > -6 && x < 24 && y < 18) << x << " " << y;
  }
  size_t within = 0;
  for (const auto& [x, y] : everywhere.seen[{"photo_0.png", SeenThrough::margin}]) {
    within += x > 0 && y > 0 && x < 16 && y < 12 ? 1 : 0;
  }
  EXPECT_GT(within, 0u);
  EXPECT_EQ((everywhere.seen[{"photo_0.png", SeenThrough::margin}].size()), pixels.size() + within);
}

}  // namespace
}  // namespace tessera
