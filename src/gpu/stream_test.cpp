#include "gpu/stream.h"

#include <gtest/gtest.h>

#include <array>
#include <numeric>

#include "gpu/testing/test_context.h"
#include "shaders/double_values.h"

namespace tessera {
namespace {

struct Arguments {
  uint64_t values;
  uint32_t count;
  uint32_t unused = 0;
};

std::vector<uint32_t> numbers(size_t count) {
  std::vector<uint32_t> values(count);
  std::iota(values.begin(), values.end(), 1u);
  return values;
}

std::vector<uint32_t> downloaded(GpuStream& stream, const GpuBuffer& buffer) {
  std::vector<uint32_t> values(buffer.bytes() / 4);
  stream.download(buffer, 0, std::as_writable_bytes(std::span(values)));
  return values;
}

void runDouble(GpuStream& stream, const GpuKernel& kernel, const GpuBuffer& buffer) {
  const Arguments arguments = {buffer.address(), static_cast<uint32_t>(buffer.bytes() / 4)};
  stream.run(kernel, std::as_bytes(std::span(&arguments, 1)), {(arguments.count + 63) / 64});
}

class GpuStreamTest : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
  }
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }

  std::shared_ptr<GpuContext> context_;
};

TEST_F(GpuStreamTest, DownloadsWhatItUploaded) {
  GpuStream stream(context_);
  const GpuBuffer buffer(context_, 4000);
  const auto values = numbers(1000);
  stream.upload(buffer, 0, std::as_bytes(std::span(values)));
  EXPECT_EQ(downloaded(stream, buffer), values);
}

TEST_F(GpuStreamTest, TransfersMoreThanItsStagingCapacity) {
  GpuStream stream(context_, 256);
  const GpuBuffer buffer(context_, 4000);
  const auto values = numbers(1000);
  stream.upload(buffer, 0, std::as_bytes(std::span(values)));
  EXPECT_EQ(downloaded(stream, buffer), values);
}

TEST_F(GpuStreamTest, ReadsWorkgroupCountsFromDeviceMemory) {
  GpuStream stream(context_);
  const GpuKernel doubles(context_, kDoubleValuesSpirv);
  const GpuBuffer buffer(context_, 4000), words(context_, 16);
  auto expected = numbers(1000);
  stream.upload(buffer, 0, std::as_bytes(std::span(expected)));
  const Arguments arguments = {buffer.address(), 1000};
  stream.finish();
  const uint64_t before = stream.batchesRecorded();
  for (const uint32_t groups : {2u, 0u, 5u, 1u, 3u}) {  // of 64 each; the commands differ only in that number
    for (uint32_t again = 0; again < 5; ++again) {      // short lists are always recorded
      const std::array<uint32_t, 3> counted = {groups + again, 1, 1};
      stream.upload(words, 4, std::as_bytes(std::span(counted)));
      stream.run(doubles, std::as_bytes(std::span(&arguments, 1)), Groups::counted(words, 4));
      for (uint32_t i = 0; i < 64 * (groups + again); ++i) expected[i] *= 2;
    }
    stream.send();
  }
  EXPECT_EQ(stream.batchesRecorded() - before, 2u) << "one of each buffer of commands";
  EXPECT_EQ(downloaded(stream, buffer), expected);
}

TEST_F(GpuStreamTest, WritesReadsAndClearsPartsOnly) {
  GpuStream stream(context_);
  const GpuBuffer buffer(context_, 40);
  auto expected = numbers(10);
  stream.upload(buffer, 0, std::as_bytes(std::span(expected)));
  const uint32_t seven = 77;
  stream.upload(buffer, 8, std::as_bytes(std::span(&seven, 1)));
  stream.fillZero(buffer, 20, 8);
  expected[2] = 77;
  expected[5] = expected[6] = 0;
  EXPECT_EQ(downloaded(stream, buffer), expected);
  uint32_t part = 0;
  stream.download(buffer, 8, std::as_writable_bytes(std::span(&part, 1)));
  EXPECT_EQ(part, 77u);
}

TEST_F(GpuStreamTest, KernelsSeeTheResultsOfThoseBeforeThem) {
  // The operations do not commute: 2(2x + 1) and 2(2x) + 1 differ, so any missing ordering shows.
  GpuStream stream(context_);
  const GpuKernel doubles(context_, kDoubleValuesSpirv);
  const uint32_t one = 1;
  const GpuKernel doublesAndAddsOne(context_, kDoubleValuesSpirv, std::span(&one, 1));
  const GpuBuffer buffer(context_, 40000);
  auto expected = numbers(10000);
  stream.upload(buffer, 0, std::as_bytes(std::span(expected)));
  for (int i = 0; i < 300; ++i) {
    runDouble(stream, i % 3 == 0 ? doublesAndAddsOne : doubles, buffer);
    for (uint32_t& value : expected) value = 2 * value + (i % 3 == 0);
    if (i == 150) stream.fillZero(buffer, 0, 400);
    if (i == 150) std::fill_n(expected.begin(), 100, 0u);
  }
  EXPECT_EQ(downloaded(stream, buffer), expected);
}

TEST_F(GpuStreamTest, ArgumentsOutliveTheCall) {
  GpuStream stream(context_, 64);  // uploads take several batches
  const GpuKernel kernel(context_, kDoubleValuesSpirv);
  const GpuBuffer a(context_, 256), b(context_, 256);
  const auto values = numbers(64);
  stream.upload(a, 0, std::as_bytes(std::span(values)));
  stream.upload(b, 0, std::as_bytes(std::span(values)));
  for (int i = 0; i < 5; ++i) runDouble(stream, kernel, i % 2 ? a : b);
  EXPECT_EQ(downloaded(stream, a)[2], 3u << 2);
  EXPECT_EQ(downloaded(stream, b)[2], 3u << 3);
}

TEST_F(GpuStreamTest, CopiesStagedBytesEvenIfArgumentsFillTheBatch) {
  GpuStream stream(context_);
  const GpuKernel kernel(context_, kDoubleValuesSpirv);
  const GpuBuffer a(context_, 256), b(context_, 256);
  struct {
    Arguments used;
    std::array<uint64_t, 500> more = {};
  } large = {{a.address(), 64}};
  for (uint32_t i = 0; i < 400; ++i) {
    const std::vector<uint32_t> values(64, i);
    stream.upload(b, 0, std::as_bytes(std::span(values)));
    stream.run(kernel, std::as_bytes(std::span(&large, 1)), {1});
    if (i % 37 == 0) {
      EXPECT_EQ(downloaded(stream, b), values);
    }
  }
  EXPECT_EQ(downloaded(stream, b)[63], 399u);
}

TEST_F(GpuStreamTest, DestroysDeferredBuffersAfterTheirWork) {
  GpuStream stream(context_);
  const GpuKernel kernel(context_, kDoubleValuesSpirv);
  for (int i = 0; i < 200; ++i) {
    GpuBuffer buffer(context_, 4096);
    stream.fillZero(buffer, 0, 4096);
    runDouble(stream, kernel, buffer);
    stream.deferDestroy(std::move(buffer));
  }
  EXPECT_NO_THROW(stream.finish());
}

TEST_F(GpuStreamTest, RecordsABatchOnceAndSendsItAgainWithOtherArgumentsUploadsAndSizes) {
  GpuStream stream(context_);
  const GpuKernel kernel(context_, kDoubleValuesSpirv);
  const GpuBuffer a(context_, 400000), b(context_, 400000);
  for (uint32_t i = 0; i < 20; ++i) {
    // Like the rays of training steps: different counts, which round to the same number of workgroups.
    const std::vector<uint32_t> values(99000 + i, i + 1);
    const size_t first = i % 3;
    for (const GpuBuffer* buffer : {&a, &b}) stream.upload(*buffer, 4 * first, std::as_bytes(std::span(values)));
    for (int k = 0; k < 5; ++k) runDouble(stream, kernel, i % 2 ? a : b);  // the address differs, which is an argument
    stream.fillZero(b, 4 * first, 4 * (98000 + i));
    uint32_t last[3] = {};
    const auto bytes = [](uint32_t& value) { return std::as_writable_bytes(std::span(&value, 1)); };
    const GpuStream::Download downloads[] = {{&a, 4 * (first + values.size() - 1), bytes(last[0])},
                                             {&b, 4 * (first + 98000 + i - 1), bytes(last[1])},
                                             {&b, 4 * (first + 98000 + i), bytes(last[2])}};
    stream.download(downloads);
    EXPECT_EQ(last[0], i % 2 ? 32 * (i + 1) : i + 1);
    EXPECT_EQ(last[1], 0u);
    EXPECT_EQ(last[2], i % 2 ? i + 1 : 32 * (i + 1));
  }
  EXPECT_EQ(stream.batchesSent(), 20u);
  EXPECT_EQ(stream.batchesRecorded(), 2u);  // once for each of its two staging buffers
}

TEST_F(GpuStreamTest, KeepsRecordingsDespiteSmallBatches) {
  GpuStream stream(context_);
  const GpuKernel kernel(context_, kDoubleValuesSpirv);
  const GpuBuffer buffer(context_, 4000);
  for (int i = 0; i < 40; ++i) {
    for (int k = 0; k < 10; ++k) runDouble(stream, kernel, buffer);
    stream.send();
    uint32_t one = 0;
    for (int k = 0; k < i % 3; ++k) stream.download(buffer, 0, std::as_writable_bytes(std::span(&one, 1)));
  }
  stream.finish();
  EXPECT_LE(stream.batchesRecorded(), 2u + 39u);  // the large ones twice
}

TEST_F(GpuStreamTest, RecordsABatchAgainIfItsBuffersAreGone) {
  GpuStream stream(context_);
  for (int i = 0; i < 6; ++i) {
    GpuBuffer large(context_, size_t{40} << 20);  // has its own block, possibly with the handle of the previous one
    constexpr size_t kPart = size_t{4'500'000};   // too large for a kernel
    for (size_t part = 0; part < 8; ++part) stream.fillZero(large, part * kPart, kPart);
    stream.fillZero(large, 8 * kPart, large.bytes() - 8 * kPart);
    uint32_t last = 1;
    stream.download(large, large.bytes() - 4, std::as_writable_bytes(std::span(&last, 1)));
    EXPECT_EQ(last, 0u);
    stream.deferDestroy(std::move(large));
    stream.finish();
  }
  EXPECT_GE(stream.batchesRecorded(), 6u);
}

TEST_F(GpuStreamTest, MeasuresWhatEachLabelTook) {
  GpuStream stream(context_);
  const GpuKernel kernel(context_, kDoubleValuesSpirv);
  const GpuBuffer buffer(context_, 4000);
  stream.measure(true);
  for (int i = 0; i < 2000; ++i) {
    stream.label(i % 2 ? "odd" : "even");
    runDouble(stream, kernel, buffer);
  }
  const auto measured = stream.measured();
  EXPECT_EQ(measured.at("odd").commands, 1000u);
  EXPECT_EQ(measured.at("even").commands, 1000u);
  EXPECT_GT(measured.at("odd").seconds, 0);
  stream.measure(false);
  runDouble(stream, kernel, buffer);
  EXPECT_TRUE(stream.measured().empty());
}

TEST_F(GpuStreamTest, WorksAfterFinishingWithoutWork) {
  GpuStream stream(context_);
  stream.finish();
  stream.finish();
  const GpuKernel kernel(context_, kDoubleValuesSpirv);
  const GpuBuffer buffer(context_, 256);
  const auto values = numbers(64);
  stream.upload(buffer, 0, std::as_bytes(std::span(values)));
  runDouble(stream, kernel, buffer);
  stream.finish();
  stream.finish();
  EXPECT_EQ(downloaded(stream, buffer)[2], 2 * values[2]);
}

TEST_F(GpuStreamTest, ThrowsIfMemoryIsInsufficient) {
  EXPECT_THROW(GpuBuffer(context_, size_t{1} << 50), Error);
}

}  // namespace
}  // namespace tessera
