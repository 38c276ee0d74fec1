#include "train/block_run.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

BlockRunOptions planned(double memoryMiB, uint64_t cardBytes) {
  BlockRunOptions options;
  options.memoryMiB = memoryMiB;
  options.cardBytes = cardBytes;
  return options;
}

TEST(BlockRun, PlansBlocksAndPhotosWithinTheMachinesMemory) {
  const BlockRunOptions options = planned(1000, 0);
  EXPECT_GT(options.bytesForBlocks(), 0);
  EXPECT_GT(options.bytesForPhotos(), 0);
  EXPECT_LT(options.bytesForBlocks() + options.bytesForPhotos(), 1000 * 1048576.0);
}

// A large machine with a small card, and the reverse.
TEST(BlockRun, PlansBlocksWithinTheMemoryOfTheCardThatTrainsThem) {
  for (const double machine : {64000.0, 1000.0}) {
    const BlockRunOptions options = planned(machine, uint64_t{4} << 30);
    EXPECT_EQ(options.bytesForBlocks(), static_cast<double>(uint64_t{2} << 30));
    EXPECT_EQ(options.bytesForPhotos(), planned(machine, 0).bytesForPhotos());
  }
}

}  // namespace
}  // namespace tessera
