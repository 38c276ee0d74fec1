// The fixture of the drawing tests: triangles on the device, the shaders that draw them, and downloads of images.
#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <vector>

#include "gpu/stream.h"
#include "gpu/testing/test_context.h"
#include "gpu/testing/triangle_rasteriser.h"
#include "shaders/triangles.h"
#include "shaders/triangles_colour.h"
#include "shaders/triangles_coverage.h"
#include "shaders/triangles_numbers.h"
#include "shaders/triangles_several.h"

namespace tessera::gpu_test {

inline constexpr ImageSize kSize = {96, 64};

class DrawTest : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
    stream_ = std::make_unique<GpuStream>(context_);
  }
  void TearDown() override {
    stream_.reset();
    EXPECT_EQ(GpuContext::validationMessages(), 0);
  }

  std::shared_ptr<GpuImage> makeImage(ImageFormat format) { return stream_->makeImage(kSize, format); }

  // Returns a buffer with these values.
  template <class T>
  GpuBuffer uploaded(const std::vector<T>& values) {
    GpuBuffer buffer(context_, values.size() * sizeof(T));
    stream_->upload(buffer, 0, std::as_bytes(std::span(values)));
    return buffer;
  }

  struct OnDevice {
    GpuBuffer vertices, indices;
    uint32_t count = 0;  // of indices
    TriangleArguments arguments;
  };
  OnDevice uploaded(const Triangles& triangles) {
    OnDevice onDevice = {
        uploaded(triangles.vertices), uploaded(triangles.indices), static_cast<uint32_t>(triangles.indices.size()), {}};
    onDevice.arguments.vertices = onDevice.vertices.address();
    onDevice.arguments.indices = onDevice.indices.address();
    onDevice.arguments.width = kSize.width;
    return onDevice;
  }

  // Keeps a reference to the arguments.
  static DrawCall call(const GpuGraphicsPipeline& pipeline, const TriangleArguments& arguments, DrawCount count) {
    return {&pipeline, std::as_bytes(std::span(&arguments, 1)), count};
  }
  static DrawCall call(const GpuGraphicsPipeline&, TriangleArguments&&, DrawCount) = delete;

  // Downloads all pixels, [height][width] values of T.
  template <class T>
  std::vector<T> pixels(const GpuImage& image) {
    GpuBuffer buffer(context_, image.copiedBytes());
    std::vector<T> values(image.copiedBytes() / sizeof(T));
    stream_->copy(image, buffer, 0);
    stream_->download(buffer, 0, std::as_writable_bytes(std::span(values)));
    return values;
  }

  // `numbers` is [height][width][instance, triangle].
  static void expectNumbers(const std::vector<RasterisedPixel>& expected, const std::vector<uint32_t>& numbers) {
    size_t certain = 0, drawn = 0;
    for (size_t p = 0; p < expected.size(); ++p) {
      if (!expected[p].isCertain) continue;
      ++certain;
      drawn += expected[p].number != 0;
      ASSERT_EQ(numbers[2 * p + 1], expected[p].number) << p % kSize.width << " " << p / kSize.width;
    }
    EXPECT_GT(certain, expected.size() * 9 / 10);
    EXPECT_GT(drawn, expected.size() / 10);
  }

  std::shared_ptr<GpuContext> context_;
  std::unique_ptr<GpuStream> stream_;
};

// Two triangles that intersect each other.
inline Triangles crossingPair() {
  Triangles pair;
  pair.vertices = {{{-0.9f, -0.8f, 0.2f, 1}, {1, 0, 0, 1}}, {{0.8f, -0.7f, 0.8f, 1}, {1, 0, 0, 1}},
                   {{0.1f, 0.9f, 0.5f, 1}, {1, 0, 0, 1}},   {{-0.8f, 0.7f, 0.7f, 1}, {0, 1, 0, 1}},
                   {{1.7f, 1.4f, 0.6f, 2}, {0, 1, 0, 1}},   {{0.0f, -0.45f, 0.15f, 0.5f}, {0, 1, 0, 1}}};
  pair.indices = {0, 1, 2, 3, 4, 5};
  return pair;
}

}  // namespace tessera::gpu_test
