// Tests of render passes among a stream's other commands: order, replayed batches, counts in memory, deferred
// destruction.
#include <optional>

#include "gpu/testing/draw_test_support.h"
#include "shaders/double_values.h"

namespace tessera::gpu_test {
namespace {

class GpuStreamDrawTest : public DrawTest {
 protected:
  struct Target {
    std::shared_ptr<GpuImage> numbers, depth;
    std::shared_ptr<GpuRenderPass> pass;
  };
  Target makeTarget() {
    Target target = {makeImage(ImageFormat::rg32Uint), makeImage(ImageFormat::depth32Float), nullptr};
    target.pass = std::make_shared<GpuRenderPass>(context_, std::vector<ColourAttachment>{{.image = target.numbers}},
                                                  DepthAttachment{.image = target.depth});
    return target;
  }
  void deferDestroy(Target target) {
    stream_->deferDestroy(std::move(target.pass));
    stream_->deferDestroy(std::move(target.numbers));
    stream_->deferDestroy(std::move(target.depth));
  }
  GpuGraphicsPipeline makePipeline() {
    return {context_, kTrianglesSpirv, kTrianglesNumbersSpirv,
            GraphicsPipelineOptions{.colours = {{ImageFormat::rg32Uint}}, .depth = ImageFormat::depth32Float}};
  }
  void runDouble(const GpuKernel& kernel, const GpuBuffer& buffer) {
    struct {
      uint64_t values;
      uint32_t count, unused = 0;
    } const arguments = {buffer.address(), static_cast<uint32_t>(buffer.bytes() / 4)};
    stream_->run(kernel, std::as_bytes(std::span(&arguments, 1)), {(arguments.count + 63) / 64});
  }
};

TEST_F(GpuStreamDrawTest, OrdersPassesAmongOtherCommands) {
  // Vertices are uploaded, indices are doubled by a kernel, and the drawn image is copied and doubled, repeatedly in
  // the same buffers: any missing ordering shows.
  const Target target = makeTarget();
  const GpuGraphicsPipeline pipeline = makePipeline();
  const GpuKernel doubles(context_, kDoubleValuesSpirv);
  const GpuBuffer vertices(context_, 48 * sizeof(Vertex)), indices(context_, 24 * 4);
  const GpuBuffer copied(context_, target.numbers->copiedBytes());
  TriangleArguments arguments;
  arguments.vertices = vertices.address();
  arguments.indices = indices.address();
  std::vector<uint32_t> numbers(copied.bytes() / 4);
  for (uint64_t seed = 0; seed < 30; ++seed) {
    const Triangles triangles = randomTriangles(seed, 8);
    std::vector<Vertex> spaced(48);  // every other one, as indices are doubled
    for (size_t i = 0; i < triangles.vertices.size(); ++i) spaced[2 * i] = triangles.vertices[i];
    stream_->upload(vertices, 0, std::as_bytes(std::span(spaced)));
    stream_->upload(indices, 0, std::as_bytes(std::span(triangles.indices)));
    runDouble(doubles, indices);
    stream_->draw(*target.pass, call(pipeline, arguments, {.vertices = 24}));
    stream_->copy(*target.numbers, copied, 0);
    runDouble(doubles, copied);
    stream_->fillZero(vertices, 0, vertices.bytes());
    if (seed % 3 != 0) continue;
    stream_->download(copied, 0, std::as_writable_bytes(std::span(numbers)));
    for (uint32_t& number : numbers) {
      ASSERT_EQ(number % 2, 0u);
      number /= 2;
    }
    expectNumbers(rasterise(triangles, kSize), numbers);
  }
}

TEST_F(GpuStreamDrawTest, RecordsAPassOnceAndSendsItAgainWithOtherArguments) {
  const Target target = makeTarget();
  const GpuGraphicsPipeline pipeline = makePipeline();
  std::vector<OnDevice> all;
  std::vector<std::vector<RasterisedPixel>> expected;
  for (uint64_t seed = 0; seed < 3; ++seed) {
    all.push_back(uploaded(randomTriangles(seed, 10)));
    expected.push_back(rasterise(randomTriangles(seed, 10), kSize));
  }
  const GpuBuffer copied(context_, target.numbers->copiedBytes());
  std::vector<uint32_t> numbers(copied.bytes() / 4);
  stream_->finish();
  const uint64_t sent = stream_->batchesSent(), recorded = stream_->batchesRecorded();
  for (size_t i = 0; i < 20; ++i) {
    const OnDevice& drawn = all[i % 3];  // at another address, which is an argument
    std::vector<TriangleArguments> arguments(10, drawn.arguments);
    std::vector<DrawCall> calls;
    for (uint32_t t = 0; t < 10; ++t) {
      arguments[t].indices += 3 * t * sizeof(uint32_t);
      calls.push_back(call(pipeline, arguments[t], {.vertices = 3}));
    }
    stream_->draw(*target.pass, calls);
    stream_->copy(*target.numbers, copied, 0);
    stream_->download(copied, 0, std::as_writable_bytes(std::span(numbers)));
    // Each draw has one triangle, whose number is 1: the image shows which pixels are covered.
    auto seen = expected[i % 3];
    for (RasterisedPixel& pixel : seen) pixel.number = pixel.number != 0;
    expectNumbers(seen, numbers);
  }
  EXPECT_EQ(stream_->batchesSent() - sent, 20u);
  EXPECT_EQ(stream_->batchesRecorded() - recorded, 2u) << "one of each buffer of commands";
}

TEST_F(GpuStreamDrawTest, ReplaysAPassFromAnyImageState) {
  const Target target = makeTarget();
  const GpuGraphicsPipeline pipeline = makePipeline();
  const GpuRenderPass onTop(context_, {{.image = target.numbers, .load = LoadOperation::keep}},
                            DepthAttachment{.image = target.depth, .load = LoadOperation::discard, .isStored = false});
  const Triangles triangles = randomTriangles(4, 12);
  const OnDevice device = uploaded(triangles);
  const GpuBuffer marked = uploaded(std::vector<uint32_t>(target.numbers->copiedBytes() / 4, 99));
  const GpuBuffer copied(context_, target.numbers->copiedBytes());
  const std::vector<DrawCall> calls(12, call(pipeline, device.arguments, {.vertices = 36}));
  std::vector<uint32_t> numbers(copied.bytes() / 4);
  stream_->finish();
  const uint64_t recorded = stream_->batchesRecorded();
  for (size_t i = 0; i < 24; ++i) {
    // Short batches in between draw to the images, copy to or from them, or discard the depths.
    if (i % 4 == 1) stream_->copy(marked, 0, *target.numbers);
    if (i % 4 == 2) stream_->draw(onTop, std::span<const DrawCall>());
    if (i % 4 == 3) stream_->copy(*target.numbers, copied, 0);
    stream_->send();
    stream_->draw(*target.pass, calls);
    stream_->send();
    stream_->copy(*target.numbers, copied, 0);
    stream_->download(copied, 0, std::as_writable_bytes(std::span(numbers)));
    expectNumbers(rasterise(triangles, kSize), numbers);
    stream_->copy(marked, 0, *target.numbers);
    stream_->send();
  }
  stream_->finish();
  const uint64_t shortOnes = 24 * 2 + 18;
  EXPECT_LE(stream_->batchesRecorded() - recorded, 2 + shortOnes);
}

TEST_F(GpuStreamDrawTest, RecordsAPassAgainIfItsDrawsDiffer) {
  const Target target = makeTarget();
  const GpuGraphicsPipeline pipeline = makePipeline();
  GraphicsPipelineOptions options = {.colours = {{ImageFormat::rg32Uint}}, .depth = ImageFormat::depth32Float};
  options.constants = {101};
  const GpuGraphicsPipeline other(context_, kTrianglesSpirv, kTrianglesNumbersSpirv, options);
  const Triangles triangles = randomTriangles(5, 12);
  const OnDevice device = uploaded(triangles);
  stream_->finish();
  const uint64_t recorded = stream_->batchesRecorded();
  for (uint32_t i = 0; i < 12; ++i) {  // equally many draws of other vertices and pipelines
    const uint32_t count = 1 + i / 2 % 3 * 5;
    const bool isOther = i / 2 % 2 == 1;
    const std::vector<DrawCall> calls(9, call(isOther ? other : pipeline, device.arguments, {.vertices = 3 * count}));
    stream_->draw(*target.pass, calls);
    stream_->send();
    Triangles some = triangles;
    some.indices.resize(3 * count);
    const auto expected = rasterise(some, kSize);
    const auto numbers = pixels<uint32_t>(*target.numbers);
    for (size_t p = 0; p < expected.size(); ++p) {
      const uint32_t first = isOther && expected[p].number != 0 ? 100 : 0;
      if (expected[p].isCertain) {
        ASSERT_EQ(numbers[2 * p + 1], first + expected[p].number);
      }
    }
  }
  EXPECT_GE(stream_->batchesRecorded() - recorded, 6u);
}

TEST_F(GpuStreamDrawTest, RecordsAPassAgainAtTheAddressOfADestroyedOne) {
  const Target targets[3] = {makeTarget(), makeTarget(), makeTarget()};
  const GpuGraphicsPipeline pipeline = makePipeline();
  const GpuBuffer copied(context_, targets[0].numbers->copiedBytes());
  std::vector<uint32_t> numbers(copied.bytes() / 4);
  std::optional<GpuRenderPass> pass;  // always at this address
  for (uint64_t i = 0; i < 9; ++i) {
    const Target& target = targets[i % 3];
    const Triangles triangles = randomTriangles(i, 12);
    const OnDevice device = uploaded(triangles);
    stream_->finish();
    pass.emplace(context_, std::vector<ColourAttachment>{{.image = target.numbers}},
                 DepthAttachment{.image = target.depth});
    stream_->draw(*pass, std::vector<DrawCall>(12, call(pipeline, device.arguments, {.vertices = 36})));
    stream_->finish();
    stream_->copy(*target.numbers, copied, 0);
    stream_->download(copied, 0, std::as_writable_bytes(std::span(numbers)));
    expectNumbers(rasterise(triangles, kSize), numbers);
  }
}

TEST_F(GpuStreamDrawTest, ReadsDrawCountsFromDeviceMemory) {
  const Target target = makeTarget();
  const GpuGraphicsPipeline pipeline = makePipeline();
  const Triangles triangles = randomTriangles(5, 12);
  const OnDevice device = uploaded(triangles);
  const GpuBuffer words(context_, 32);
  std::vector<uint32_t> numbers(target.numbers->copiedBytes() / 4);
  const GpuBuffer copied(context_, target.numbers->copiedBytes());
  stream_->finish();
  const uint64_t recorded = stream_->batchesRecorded();
  for (uint32_t count = 0; count <= 12; ++count) {
    const std::array<uint32_t, 4> counted = {3 * count, 1, 0, 0};
    stream_->upload(words, 8, std::as_bytes(std::span(counted)));
    const std::vector<DrawCall> calls(8, call(pipeline, device.arguments, DrawCount::counted(words, 8)));
    stream_->draw(*target.pass, calls);
    stream_->copy(*target.numbers, copied, 0);
    stream_->download(copied, 0, std::as_writable_bytes(std::span(numbers)));
    Triangles some = triangles;
    some.indices.resize(counted[0]);
    const auto expected = rasterise(some, kSize);
    for (size_t p = 0; p < expected.size(); ++p) {
      if (expected[p].isCertain) {
        ASSERT_EQ(numbers[2 * p + 1], expected[p].number);
      }
    }
  }
  EXPECT_EQ(stream_->batchesRecorded() - recorded, 2u) << "the commands differ only in the values in memory";
}

TEST_F(GpuStreamDrawTest, ReadsInstancesAndTheFirstVertexFromDeviceMemory) {
  const Target target = makeTarget();
  const GpuGraphicsPipeline pipeline = makePipeline();
  Triangles triangles = randomTriangles(6, 1);
  triangles.vertices.insert(triangles.vertices.end(),
                            {{{-1, -1, 0.5f, 1}}, {{-0.5f, -1, 0.5f, 1}}, {{-1, 0, 0.5f, 1}}});
  triangles.indices.insert(triangles.indices.end(), {3, 4, 5});
  const OnDevice device = uploaded(triangles);
  TriangleArguments arguments = device.arguments;
  arguments.shift = {0.5f, 0.25f};
  const GpuBuffer words = uploaded(std::vector<uint32_t>{3, 4, 3, 0});
  stream_->draw(*target.pass, call(pipeline, arguments, DrawCount::counted(words, 0)));
  const auto counted = pixels<uint32_t>(*target.numbers);
  // The expected image has four shifted triangles.
  std::array<size_t, 4> seen = {};
  for (uint32_t instance = 0; instance < 4; ++instance) {
    Triangles shifted = triangles;
    shifted.indices = {3, 4, 5};
    for (Vertex& vertex : shifted.vertices) {
      vertex.position[0] += 0.5f * static_cast<float>(instance);
      vertex.position[1] += 0.25f * static_cast<float>(instance);
    }
    const auto expected = rasterise(shifted, kSize);
    for (size_t p = 0; p < expected.size(); ++p) {
      if (!expected[p].isCertain || expected[p].number == 0) continue;
      ++seen[instance];
      ASSERT_EQ(counted[2 * p], instance);
      ASSERT_EQ(counted[2 * p + 1], 2u) << "the second triangle";
    }
  }
  for (const size_t count : seen) EXPECT_GT(count, 100u);
}

TEST_F(GpuStreamDrawTest, DestroysDeferredImagesAndPassesAfterTheirWork) {
  const GpuGraphicsPipeline pipeline = makePipeline();
  const Triangles triangles = randomTriangles(3, 12);
  const auto expected = rasterise(triangles, kSize);
  const OnDevice device = uploaded(triangles);
  const size_t before = context_->heap().bytesInUse();
  const std::vector<DrawCall> calls(12, call(pipeline, device.arguments, {.vertices = 36}));
  std::vector<std::weak_ptr<GpuRenderPass>> passes;
  std::vector<GpuBuffer> copies;
  for (int i = 0; i < 30; ++i) {
    Target target = makeTarget();
    passes.push_back(target.pass);
    GpuBuffer& copied = copies.emplace_back(context_, target.numbers->copiedBytes());
    stream_->draw(*target.pass, calls);
    stream_->copy(*target.numbers, copied, 0);
    deferDestroy(std::move(target));
    EXPECT_FALSE(passes.back().expired());
    stream_->send();  // the next target may get the memory, the handles and the addresses of the last but one
  }
  for (const GpuBuffer& copied : copies) {
    std::vector<uint32_t> numbers(copied.bytes() / 4);
    stream_->download(copied, 0, std::as_writable_bytes(std::span(numbers)));
    expectNumbers(expected, numbers);
  }
  for (const auto& pass : passes) EXPECT_TRUE(pass.expired());
  copies.clear();
  EXPECT_LE(context_->heap().bytesInUse(), before + (size_t{16} << 20)) << "the staging buffer of downloads";
}

TEST_F(GpuStreamDrawTest, TakesMoreDrawsThanABatchHasCommands) {
  const Target target = makeTarget();
  const GpuGraphicsPipeline pipeline = makePipeline();
  const Triangles triangles = randomTriangles(2, 12);
  const OnDevice device = uploaded(triangles);
  const std::vector<DrawCall> calls(5000, call(pipeline, device.arguments, {.vertices = 36}));
  stream_->draw(*target.pass, calls);
  stream_->draw(*target.pass, calls);  // in a batch of its own: arguments are many
  expectNumbers(rasterise(triangles, kSize), pixels<uint32_t>(*target.numbers));
}

TEST_F(GpuStreamDrawTest, MeasuresPassesToo) {
  const Target target = makeTarget();
  const GpuGraphicsPipeline pipeline = makePipeline();
  const OnDevice device = uploaded(randomTriangles(2, 12));
  stream_->measure(true);
  const std::vector<DrawCall> calls(3, call(pipeline, device.arguments, {.vertices = 36}));
  for (int i = 0; i < 20; ++i) {
    stream_->label("draw");
    stream_->draw(*target.pass, calls);
    stream_->send();
  }
  const auto measured = stream_->measured();
  EXPECT_EQ(measured.at("draw").commands, 20u);
  EXPECT_GT(measured.at("draw").seconds, 0);
}

}  // namespace
}  // namespace tessera::gpu_test
