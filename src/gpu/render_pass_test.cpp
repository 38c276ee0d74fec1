#include "gpu/render_pass.h"

#include <cmath>

#include "base/error.h"
#include "gpu/testing/draw_test_support.h"

namespace tessera::gpu_test {
namespace {

class GpuRenderPassTest : public DrawTest {
 protected:
  // Draws the triangles' numbers with a depth image that is cleared to `clearDepth`, and returns the pixels.
  std::vector<uint32_t> drawNumbers(const Triangles& triangles, GraphicsPipelineOptions options, float clearDepth = 1) {
    const auto numbers = makeImage(ImageFormat::rg32Uint);
    depth_ = makeImage(ImageFormat::depth32Float);
    const GpuRenderPass pass(context_, {{.image = numbers}},
                             DepthAttachment{.image = depth_, .clearDepth = clearDepth});
    options.colours = {{ImageFormat::rg32Uint}};
    options.depth = ImageFormat::depth32Float;
    pipelines_.push_back(
        std::make_unique<GpuGraphicsPipeline>(context_, kTrianglesSpirv, kTrianglesNumbersSpirv, options));
    const OnDevice device = uploaded(triangles);
    stream_->draw(pass, call(*pipelines_.back(), device.arguments, {.vertices = device.count}));
    auto values = pixels<uint32_t>(*numbers);
    stream_->finish();
    return values;
  }

  // Returns the reason of the error that `make` throws.
  template <class Make>
  static std::string catchErrorReason(const Make& make) {
    try {
      make();
    } catch (const Error& error) {
      return error.reason();
    }
    return "nothing was thrown";
  }

  std::shared_ptr<GpuImage> depth_;
  std::vector<std::unique_ptr<GpuGraphicsPipeline>> pipelines_;
};

TEST_F(GpuRenderPassTest, DrawsTheNearerOfTwoTrianglesThatCross) {
  const Triangles pair = crossingPair();
  const auto expected = rasterise(pair, kSize);
  expectNumbers(expected, drawNumbers(pair, {}));
  const auto depths = pixels<float>(*depth_);
  std::array<size_t, 3> count = {};
  for (size_t p = 0; p < expected.size(); ++p) {
    if (!expected[p].isCertain) continue;
    EXPECT_NEAR(depths[p], expected[p].depth, 1e-4);
    ++count[expected[p].number];
  }
  for (const size_t of : count) EXPECT_GT(of, expected.size() / 20) << "each triangle and the background are seen";
}

TEST_F(GpuRenderPassTest, DrawsTheNearestOfManyTriangles) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const Triangles triangles = randomTriangles(seed, 12);
    expectNumbers(rasterise(triangles, kSize), drawNumbers(triangles, {}));
  }
}

TEST_F(GpuRenderPassTest, ComparesDepthsAsThePipelineSays) {
  // Reversed depths drawn with the reversed test give the same image.
  const Triangles triangles = randomTriangles(7, 12);
  Triangles reversed = triangles;
  for (Vertex& vertex : reversed.vertices) vertex.position[2] = vertex.position[3] - vertex.position[2];
  expectNumbers(rasterise(triangles, kSize), drawNumbers(reversed, {.depthCompare = VK_COMPARE_OP_GREATER}, 0));
}

TEST_F(GpuRenderPassTest, DrawsTheLastTriangleWhereDepthsAreNotTested) {
  const Triangles triangles = randomTriangles(8, 12);
  auto expected = rasterise(triangles, kSize);
  for (RasterisedPixel& pixel : expected) pixel.number = pixel.largest;
  expectNumbers(expected, drawNumbers(triangles, {.depthTest = false}));
  for (const float depth : pixels<float>(*depth_)) EXPECT_EQ(depth, 1.0f);
  expectNumbers(expected, drawNumbers(triangles, {.depthWrite = false}));
  for (const float depth : pixels<float>(*depth_)) EXPECT_EQ(depth, 1.0f);
}

TEST_F(GpuRenderPassTest, CullsByWinding) {
  const Triangles triangles = randomTriangles(9, 16);
  const auto clockwise = rasterise(triangles, kSize, Faces::clockwise);
  const auto counterClockwise = rasterise(triangles, kSize, Faces::counterClockwise);
  expectNumbers(counterClockwise, drawNumbers(triangles, {.cull = VK_CULL_MODE_BACK_BIT}));
  expectNumbers(clockwise, drawNumbers(triangles, {.cull = VK_CULL_MODE_FRONT_BIT}));
  expectNumbers(clockwise,
                drawNumbers(triangles, {.cull = VK_CULL_MODE_BACK_BIT, .frontFace = VK_FRONT_FACE_CLOCKWISE}));
}

TEST_F(GpuRenderPassTest, SpecialisesBothShaders) {
  const Triangles pair = crossingPair();
  auto expected = rasterise(pair, kSize);
  for (RasterisedPixel& pixel : expected) pixel.number += pixel.number != 0 ? 1000 : 0;
  expectNumbers(expected, drawNumbers(pair, {.constants = {1001}}));
}

TEST_F(GpuRenderPassTest, LetsFragmentShadersWriteToBuffers) {
  const Triangles triangles = randomTriangles(10, 20);
  const auto expected = rasterise(triangles, kSize);
  depth_ = makeImage(ImageFormat::depth32Float);
  const GpuRenderPass pass(context_, {}, DepthAttachment{.image = depth_, .isStored = false});
  const GpuGraphicsPipeline pipeline(context_, kTrianglesSpirv, kTrianglesCoverageSpirv,
                                     {.depth = ImageFormat::depth32Float, .depthTest = false, .fragmentStores = true});
  const OnDevice device = uploaded(triangles);
  const GpuBuffer covered(context_, expected.size() * 4), largest(context_, expected.size() * 4);
  stream_->fillZero(covered, 0, covered.bytes());
  stream_->fillZero(largest, 0, largest.bytes());
  TriangleArguments arguments = device.arguments;
  arguments.covered = covered.address();
  arguments.largest = largest.address();
  stream_->draw(pass, call(pipeline, arguments, {.vertices = device.count}));
  std::vector<uint32_t> counts(expected.size()), numbers(expected.size());
  stream_->download(covered, 0, std::as_writable_bytes(std::span(counts)));
  stream_->download(largest, 0, std::as_writable_bytes(std::span(numbers)));
  size_t several = 0;
  for (size_t p = 0; p < expected.size(); ++p) {
    if (!expected[p].isCertain) continue;
    ASSERT_EQ(counts[p], expected[p].covered) << p;
    ASSERT_EQ(numbers[p], expected[p].largest) << p;
    several += expected[p].covered > 1;
  }
  EXPECT_GT(several, expected.size() / 4);
}

TEST_F(GpuRenderPassTest, FillsSeveralImagesAtOnceAndClearsEachToItsOwnValue) {
  const Triangles triangles = crossingPair();
  const auto numbers = makeImage(ImageFormat::rg32Uint), colour = makeImage(ImageFormat::rgba32Float),
             depth = makeImage(ImageFormat::r32Float);
  depth_ = makeImage(ImageFormat::depth32Float);
  const GpuRenderPass pass(context_,
                           {{.image = numbers, .clearInteger = {7, 4'000'000'000u}},
                            {.image = colour, .clearColour = {0.25f, -3, 1e6f, 0.5f}},
                            {.image = depth, .clearColour = {-1}}},
                           DepthAttachment{.image = depth_, .clearDepth = 0.75f});
  const GpuGraphicsPipeline pipeline(
      context_, kTrianglesSpirv, kTrianglesSeveralSpirv,
      {.colours = {{ImageFormat::rg32Uint}, {ImageFormat::rgba32Float}, {ImageFormat::r32Float}},
       .depth = ImageFormat::depth32Float,
       .depthCompare = VK_COMPARE_OP_ALWAYS});
  const OnDevice device = uploaded(triangles);
  // Only the first triangle is drawn, over the background.
  stream_->draw(pass, call(pipeline, device.arguments, {.vertices = 3}));
  const auto numbersDrawn = pixels<uint32_t>(*numbers);
  const auto coloursDrawn = pixels<std::array<float, 4>>(*colour);
  const auto depthsDrawn = pixels<float>(*depth), depthsKept = pixels<float>(*depth_);
  Triangles first = triangles;
  first.indices.resize(3);
  const auto alone = rasterise(first, kSize);
  size_t background = 0;
  for (size_t p = 0; p < alone.size(); ++p) {
    if (!alone[p].isCertain) continue;
    const bool isDrawn = alone[p].number != 0;
    background += !isDrawn;
    ASSERT_EQ(numbersDrawn[2 * p], isDrawn ? 0u : 7u);
    ASSERT_EQ(numbersDrawn[2 * p + 1], isDrawn ? 1u : 4'000'000'000u);
    ASSERT_EQ(coloursDrawn[p], (isDrawn ? std::array{1.0f, 0.0f, 0.0f, 1.0f} : std::array{0.25f, -3.0f, 1e6f, 0.5f}));
    ASSERT_NEAR(depthsDrawn[p], isDrawn ? alone[p].depth : -1, 1e-4);
    ASSERT_NEAR(depthsKept[p], isDrawn ? alone[p].depth : 0.75, 1e-4);
  }
  EXPECT_GT(background, alone.size() / 4);
}

TEST_F(GpuRenderPassTest, InterpolatesAttributesPerspectiveCorrectly) {
  const Triangles triangles = randomTriangles(11, 12);
  const auto expected = rasterise(triangles, kSize);
  const auto exact = makeImage(ImageFormat::rgba32Float), half = makeImage(ImageFormat::rgba16Float),
             bytes = makeImage(ImageFormat::rgba8);
  depth_ = makeImage(ImageFormat::depth32Float);
  const OnDevice device = uploaded(triangles);
  for (const auto& image : {exact, half, bytes}) {
    const GpuRenderPass pass(context_, {{.image = image}}, DepthAttachment{.image = depth_, .isStored = false});
    pipelines_.push_back(std::make_unique<GpuGraphicsPipeline>(
        context_, kTrianglesSpirv, kTrianglesColourSpirv,
        GraphicsPipelineOptions{.colours = {{image->format()}}, .depth = ImageFormat::depth32Float}));
    stream_->draw(pass, call(*pipelines_.back(), device.arguments, {.vertices = device.count}));
    stream_->finish();
  }
  const auto floats = pixels<std::array<float, 4>>(*exact);
  const auto halves = pixels<std::array<uint16_t, 4>>(*half);
  const auto bytesDrawn = pixels<std::array<uint8_t, 4>>(*bytes);
  for (size_t p = 0; p < expected.size(); ++p) {
    if (!expected[p].isCertain) continue;
    for (size_t c = 0; c < 4; ++c) {
      ASSERT_NEAR(floats[p][c], expected[p].colour[c], 2e-3) << p;
      ASSERT_NEAR(bytesDrawn[p][c], 255 * expected[p].colour[c], 1.1) << p;
    }
    if (expected[p].number == 0) {
      EXPECT_EQ(halves[p], (std::array<uint16_t, 4>{}));
      continue;
    }
    for (size_t c = 0; c < 4; ++c) {  // exponent and fraction, of numbers between 2^-14 and 1
      const double value = std::ldexp(1024 + (halves[p][c] & 1023), (halves[p][c] >> 10) - 25);
      ASSERT_NEAR(value, expected[p].colour[c], 3e-3) << p;
    }
  }
}

TEST_F(GpuRenderPassTest, LoadsTheResultOfAnEarlierPass) {
  const Triangles pair = crossingPair();
  const auto numbers = makeImage(ImageFormat::rg32Uint);
  depth_ = makeImage(ImageFormat::depth32Float);
  const GpuRenderPass first(context_, {{.image = numbers}}, DepthAttachment{.image = depth_});
  const GpuRenderPass then(context_, {{.image = numbers, .load = LoadOperation::keep}},
                           DepthAttachment{.image = depth_, .load = LoadOperation::keep});
  const GraphicsPipelineOptions options = {.colours = {{ImageFormat::rg32Uint}}, .depth = ImageFormat::depth32Float};
  const GpuGraphicsPipeline pipeline(context_, kTrianglesSpirv, kTrianglesNumbersSpirv, options);
  GraphicsPipelineOptions second = options;
  second.constants = {2};
  const GpuGraphicsPipeline pipelineOfTheSecond(context_, kTrianglesSpirv, kTrianglesNumbersSpirv, second);
  const OnDevice device = uploaded(pair);
  TriangleArguments later = device.arguments;
  later.indices += 3 * sizeof(uint32_t);
  stream_->draw(first, call(pipeline, device.arguments, {.vertices = 3}));
  stream_->draw(then, call(pipelineOfTheSecond, later, {.vertices = 3}));
  stream_->draw(then, std::span<const DrawCall>());
  expectNumbers(rasterise(pair, kSize), pixels<uint32_t>(*numbers));
  // A pass without draws clears.
  stream_->draw(first, std::span<const DrawCall>());
  for (const uint32_t number : pixels<uint32_t>(*numbers)) ASSERT_EQ(number, 0u);
}

TEST_F(GpuRenderPassTest, BlendsWithEveryMode) {
  // Two triangles that cover the whole image, drawn one after the other.
  Triangles both;
  const std::array<float, 4> below = {0.5f, 0.25f, 0, 0.5f}, above = {0.125f, 0, 0.25f, 0.25f};
  for (const auto& colour : {below, above}) {
    both.vertices.push_back({{-1, -1, 0.5f, 1}, colour});
    both.vertices.push_back({{3, -1, 0.5f, 1}, colour});
    both.vertices.push_back({{-1, 3, 0.5f, 1}, colour});
  }
  both.indices = {0, 1, 2, 3, 4, 5};
  const OnDevice device = uploaded(both);
  for (const Blend blend : {Blend::none, Blend::premultipliedOver, Blend::add}) {
    const auto image = makeImage(ImageFormat::rgba16Float), exact = makeImage(ImageFormat::rgba8);
    for (const auto& target : {image, exact}) {
      const GpuRenderPass pass(context_, {{.image = target, .clearColour = {1, 1, 1, 1}}});
      pipelines_.push_back(
          std::make_unique<GpuGraphicsPipeline>(context_, kTrianglesSpirv, kTrianglesColourSpirv,
                                                GraphicsPipelineOptions{.colours = {{target->format(), blend}}}));
      stream_->draw(pass, call(*pipelines_.back(), device.arguments, {.vertices = 6}));
      stream_->finish();
    }
    for (const auto& pixel : pixels<std::array<uint8_t, 4>>(*exact)) {
      for (size_t c = 0; c < 4; ++c) {
        float expected = 1;
        for (const auto& colour : {below, above}) {
          if (blend == Blend::none) expected = colour[c];
          if (blend == Blend::premultipliedOver) expected = colour[c] + (1 - colour[3]) * expected;
          if (blend == Blend::add) expected = std::min(expected + colour[c], 1.0f);
        }
        ASSERT_NEAR(pixel[c], 255 * expected, 1.6);
      }
    }
  }
}

TEST_F(GpuRenderPassTest, ReportsWhatTheDeviceDoesNotSupport) {
  GpuOptions options;
  options.allowedGraphics = {.queue = true, .fragmentStores = false, .independentBlend = false};
  const auto lesser = openForTest(options);
  const auto make = [&](const std::shared_ptr<GpuContext>& context, const GraphicsPipelineOptions& pipelineOptions) {
    return catchErrorReason(
        [&] { GpuGraphicsPipeline(context, kTrianglesSpirv, kTrianglesSeveralSpirv, pipelineOptions); });
  };
  const GraphicsPipelineOptions stores = {.colours = {{ImageFormat::rg32Uint}}, .fragmentStores = true};
  EXPECT_EQ(make(lesser, stores), "its fragment shaders do not write to buffers");
  const GraphicsPipelineOptions blends = {
      .colours = {{ImageFormat::rg32Uint}, {ImageFormat::rgba16Float, Blend::add}, {ImageFormat::r32Float}}};
  EXPECT_EQ(make(lesser, blends), "it does not blend several images in different ways at once");
  if (context_->graphics().independentBlend) {
    EXPECT_EQ(make(context_, blends), "nothing was thrown");
  }
  options.allowedGraphics.queue = false;
  EXPECT_EQ(make(openForTest(options), {}), "it computes, but does not rasterise");
}

TEST_F(GpuRenderPassTest, RejectsTooManyColourImages) {
  const uint32_t maximum = context_->limits().maxColorAttachments;
  std::vector<ColourAttachment> colours;
  for (uint32_t i = 0; i <= maximum; ++i) colours.push_back({.image = makeImage(ImageFormat::rgba8)});
  const std::string reason = catchErrorReason([&] { GpuRenderPass(context_, colours); });
  EXPECT_EQ(reason, std::to_string(maximum + 1) + " colour images are rendered at once, and it renders " +
                        std::to_string(maximum) + " at most");
}

}  // namespace
}  // namespace tessera::gpu_test
