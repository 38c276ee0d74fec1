#include "gpu/heap.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "gpu/buffer.h"
#include "gpu/testing/test_context.h"

namespace tessera {
namespace {

class GpuHeapTest : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
  }
  std::shared_ptr<GpuContext> context_;
};

TEST_F(GpuHeapTest, TakesOneBlockForManySmallBuffers) {
  std::vector<GpuBuffer> buffers;
  for (int i = 0; i < 1000; ++i) buffers.emplace_back(context_, 1000);
  EXPECT_EQ(context_->heap().blockCount(), 1u);
  EXPECT_EQ(context_->heap().bytesInUse(), 1000u * 1024u);
  for (size_t i = 1; i < buffers.size(); ++i) EXPECT_NE(buffers[i].address(), buffers[i - 1].address());
}

TEST_F(GpuHeapTest, GivesLargeBuffersTheirOwnBlockAndFreesIt) {
  const uint64_t generation = context_->heap().generation();
  {
    const GpuBuffer large(context_, size_t{40} << 20), small(context_, 4);
    EXPECT_EQ(large.offset(), 0u);
    EXPECT_EQ(context_->heap().blockCount(), 2u);
  }
  EXPECT_EQ(context_->heap().blockCount(), 1u);  // the shared one is kept for the next buffer
  EXPECT_EQ(context_->heap().bytesInUse(), 0u);
  EXPECT_GT(context_->heap().generation(), generation);
}

TEST_F(GpuHeapTest, AlignsEveryBuffer) {
  const GpuBuffer first(context_, 1), second(context_, 1);
  EXPECT_EQ(first.address() % 256, 0u);
  EXPECT_EQ(second.address() % 256, 0u);
}

TEST_F(GpuHeapTest, ReportsTheMemoryInUseIfAllocationFails) {
  const GpuBuffer some(context_, size_t{3} << 20);
  try {
    const GpuBuffer impossible(context_, size_t{1} << 46);
    FAIL() << "nothing was thrown";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("3 MiB in use"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace tessera
