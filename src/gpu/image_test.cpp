#include "gpu/image.h"

#include <gtest/gtest.h>

#include <cstring>

#include "base/error.h"
#include "gpu/stream.h"
#include "gpu/testing/test_context.h"

namespace tessera {
namespace {

constexpr ImageFormat kAllFormats[] = {ImageFormat::rgba8,       ImageFormat::rgba16Float, ImageFormat::r32Float,
                                       ImageFormat::rgba32Float, ImageFormat::r32Uint,     ImageFormat::rg32Uint,
                                       ImageFormat::depth32Float};

class GpuImageTest : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
  }
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }

  // Returns the reason of the error for an image that cannot be created.
  std::string imageErrorReason(ImageSize size, ImageFormat format) {
    try {
      const GpuImage image(context_, size, format);
    } catch (const Error& error) {
      return error.reason();
    }
    return "nothing was thrown";
  }

  std::shared_ptr<GpuContext> context_;
};

// Returns bytes that every format preserves exactly: they are valid as small floats, halves and integers.
std::vector<std::byte> someBytes(const GpuImage& image, float first) {
  std::vector<std::byte> bytes(image.copiedBytes());
  for (size_t i = 0; i < bytes.size() / 4; ++i) {
    const float value = (first + static_cast<float>(i % 97)) / 128;
    std::memcpy(bytes.data() + 4 * i, &value, 4);
  }
  return bytes;
}

TEST_F(GpuImageTest, RoundTripsCopiesInEveryFormat) {
  GpuStream stream(context_);
  for (const ImageFormat format : kAllFormats) {
    SCOPED_TRACE(formatName(format));
    const GpuImage image(context_, {37, 21}, format);
    EXPECT_EQ(image.copiedBytes(), 37u * 21u * bytesPerPixel(format));
    GpuBuffer from(context_, image.copiedBytes() + 32), to(context_, image.copiedBytes() + 48);
    const auto bytes = someBytes(image, 1);
    stream.upload(from, 32, bytes);
    stream.copy(from, 32, image);
    stream.fillZero(to, 0, to.bytes() / 4 * 4);
    stream.copy(image, to, 16);
    std::vector<std::byte> copied(to.bytes());
    stream.download(to, 0, copied);
    EXPECT_EQ(std::memcmp(copied.data() + 16, bytes.data(), bytes.size()), 0);
    for (size_t i = 0; i < 48; ++i) EXPECT_EQ(copied[i < 16 ? i : bytes.size() + i], std::byte{0});
    stream.deferDestroy(std::move(from));
    stream.deferDestroy(std::move(to));
    stream.finish();
  }
}

TEST_F(GpuImageTest, HoldsTheLastCopy) {
  GpuStream stream(context_);
  const GpuImage image(context_, {64, 64}, ImageFormat::rgba8);
  GpuBuffer from(context_, image.copiedBytes()), to(context_, 2 * image.copiedBytes());
  for (float i = 0; i < 20; ++i) {
    const auto first = someBytes(image, i), second = someBytes(image, i + 7);
    stream.upload(from, 0, first);
    stream.copy(from, 0, image);
    stream.copy(image, to, 0);
    stream.upload(from, 0, second);
    stream.copy(from, 0, image);
    stream.copy(image, to, image.copiedBytes());
    std::vector<std::byte> copied(to.bytes());
    stream.download(to, 0, copied);
    EXPECT_EQ(std::memcmp(copied.data(), first.data(), first.size()), 0);
    EXPECT_EQ(std::memcmp(copied.data() + first.size(), second.data(), second.size()), 0);
  }
}

TEST_F(GpuImageTest, CountsItsMemoryInTheHeapAndFreesIt) {
  const GpuHeap& heap = context_->heap();
  const GpuBuffer buffer(context_, 1000);
  const size_t before = heap.bytesInUse();
  {
    std::vector<std::unique_ptr<GpuImage>> images;
    size_t bytes = 0;
    for (const ImageFormat format : kAllFormats) {
      images.push_back(std::make_unique<GpuImage>(context_, ImageSize{256, 256}, format));
      EXPECT_GE(images.back()->memoryBytes(), images.back()->copiedBytes());
      bytes += images.back()->memoryBytes();
    }
    EXPECT_EQ(heap.bytesInUse(), before + bytes);
    const uint64_t generation = heap.generation();
    const size_t blocks = heap.blockCount();
    const auto large = std::make_unique<GpuImage>(context_, ImageSize{4096, 4096}, ImageFormat::rgba8);
    EXPECT_EQ(heap.blockCount(), blocks + 1);
    EXPECT_EQ(heap.generation(), generation);
  }
  EXPECT_EQ(heap.bytesInUse(), before);
}

TEST_F(GpuImageTest, DoesNotOverlapOtherImages) {
  GpuStream stream(context_);
  std::vector<std::shared_ptr<GpuImage>> images;
  for (uint32_t i = 0; i < 30; ++i) images.push_back(stream.makeImage({100 + i, 50}, kAllFormats[i % 7]));
  const size_t maximum = size_t{130} * 50 * 16;
  const GpuBuffer buffer(context_, maximum);
  for (size_t i = 0; i < images.size(); ++i) {
    stream.upload(buffer, 0, someBytes(*images[i], static_cast<float>(i % 30)));
    stream.copy(buffer, 0, *images[i]);
  }
  for (size_t i = 0; i < images.size(); ++i) {
    const auto expected = someBytes(*images[i], static_cast<float>(i % 30));
    std::vector<std::byte> copied(expected.size());
    stream.copy(*images[i], buffer, 0);
    stream.download(buffer, 0, copied);
    EXPECT_TRUE(copied == expected) << i;
  }
}

TEST_F(GpuImageTest, RejectsSizesBeyondTheLimit) {
  const uint32_t beyond = context_->limits().maxImageDimension2D + 1;
  const std::string reason = imageErrorReason({beyond, 4}, ImageFormat::rgba8);
  EXPECT_NE(reason.find(std::to_string(beyond) + " x 4 pixels is larger"), std::string::npos) << reason;
}

TEST_F(GpuImageTest, RejectsDevicesThatDoNotRasterise) {
  GpuOptions options;
  options.allowedGraphics.queue = false;
  context_ = openForTest(options);
  EXPECT_EQ(imageErrorReason({4, 4}, ImageFormat::rgba8), "it computes, but does not rasterise");
}

TEST_F(GpuImageTest, IsDestroyedAfterItsPendingWork) {
  GpuStream stream(context_);
  auto image = stream.makeImage({512, 512}, ImageFormat::rgba32Float);
  const auto bytes = someBytes(*image, 3);
  const GpuBuffer from(context_, bytes.size()), to(context_, bytes.size());
  const size_t before = context_->heap().bytesInUse();
  const std::weak_ptr<GpuImage> watched = image;
  stream.upload(from, 0, bytes);
  stream.copy(from, 0, *image);
  stream.copy(*image, to, 0);
  const size_t itsBytes = image->memoryBytes();
  stream.deferDestroy(std::move(image));
  EXPECT_FALSE(watched.expired());
  std::vector<std::byte> copied(bytes.size());
  stream.download(to, 0, copied);
  EXPECT_TRUE(copied == bytes);
  EXPECT_TRUE(watched.expired());
  EXPECT_LE(context_->heap().bytesInUse() + itsBytes, before + (size_t{16} << 20)) << "but for the stream's staging";
}

}  // namespace
}  // namespace tessera
