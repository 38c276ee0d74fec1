#include "train/block_run.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

BlockRunOptions planned(double memoryMiB, uint64_t gpuBytes) {
  BlockRunOptions options;
  options.memoryMiB = memoryMiB;
  options.gpuBytes = gpuBytes;
  return options;
}

TEST(BlockRun, PlansBlocksAndPhotosWithinTheMachinesMemory) {
  const BlockRunOptions options = planned(1000, 0);
  EXPECT_GT(options.bytesForBlocks(), 0);
  EXPECT_GT(options.bytesForPhotos(), 0);
  EXPECT_LT(options.bytesForBlocks() + options.bytesForPhotos(), 1000 * 1048576.0);
}

TEST(BlockRun, PlansBlocksWithinTheMemoryOfTheGpuThatTrainsThem) {
  for (const uint64_t gibibytes : {1, 1000}) {
    const BlockRunOptions options = planned(0, gibibytes << 30);
    EXPECT_EQ(options.bytesForBlocks(), static_cast<double>(gibibytes << 29));
    EXPECT_GT(options.bytesForPhotos(), 0);
  }
}

TEST(BlockRun, LimitsThePlanOnAGpuToTheGivenMemory) {
  EXPECT_EQ(planned(1000, uint64_t{100} << 30).bytesForBlocks(), planned(1000, 0).bytesForBlocks());
  EXPECT_LT(planned(100000, uint64_t{1} << 30).bytesForBlocks(), planned(100000, 0).bytesForBlocks());
}

}  // namespace
}  // namespace tessera
