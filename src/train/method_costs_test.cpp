#include "train/method_costs.h"

#include <gtest/gtest.h>

#include "partition/partition.h"
#include "partition/testing/test_captures.h"

namespace tessera {
namespace {

class NoSettings final : public MethodSettings {
 public:
  std::vector<ConfigField> fields() override { return {}; }
  void check() const override {}
  void adoptTunedValues(const MethodSettings&) override {}
};

// Blocks of so many texels, which take 10 MB each; as many as there is detail.
template <int kTexels = 100>
Method method() {
  Method method;
  method.costs = {
      .secondsPerStep = 0.1, .bakeSeconds = 10, .secondsPerBakedMegapixel = 3, .trainBytes = 500, .modelBytes = 300};
  method.settings = [](const std::string&) -> std::unique_ptr<MethodSettings> {
    return std::make_unique<NoSettings>();
  };
  method.blockDemand = [](const MethodSettings&, const BlockRunOptions&) -> BlockDemand {
    const auto topLevel = [](uint32_t columns, uint32_t rows) { return columns * rows > 4 ? 2u : 1u; };
    return {.limits = {.texelsPerEdge = kTexels, .bytesPerBlock = 1e7, .memoryBudget = 1e12},
            .lodStepFraction = 0.2,
            .topLevel = topLevel};
  };
  return method;
}

TEST(MethodCosts, AreThoseOfOneBlockForASmallPlace) {
  const MethodCosts costs = costsOnCapture(method<2000>(), flight(10, 8, 20, 60), 0);
  EXPECT_EQ(costs.trainBytes, 500);
  EXPECT_EQ(costs.modelBytes, 300);
  EXPECT_EQ(costs.bakeSeconds, 10);
  EXPECT_EQ(costs.coarserLevels, 0);
}

TEST(MethodCosts, GrowWithTheBlocksThatTrainingCuts) {
  const Capture town = flight(10, 8, 20, 60);
  PartitionOptions options;
  options.limits = method().blockDemand(NoSettings(), {}).limits;
  const int blocks = partitionCapture(town, options).grid.cells();
  ASSERT_GT(blocks, 4);
  const MethodCosts costs = costsOnCapture(method(), town, 0);
  EXPECT_EQ(costs.trainBytes, 500 + (blocks - 1) * 10000000);
  EXPECT_NEAR(costs.coarserLevels, 1.4 * (0.2 + 0.4), 1e-6);
  EXPECT_EQ(costs.modelBytes, 300 * blocks * 4 / 3);
  EXPECT_EQ(costs.bakeSeconds, 10 * blocks);
  EXPECT_NEAR(costs.secondsPerBakedMegapixel, 3 * (1 + 2 * 0.17), 1e-9);
  EXPECT_EQ(costs.secondsPerStep, 0.1) << "of all blocks together";
}

TEST(MethodCosts, LeaveBlocksThatAGpuStoresOutOfTheMachinesMemory) {
  const MethodCosts costs = costsOnCapture(method(), flight(10, 8, 20, 60), uint64_t{24} << 30);
  EXPECT_EQ(costs.trainBytes, 500);
  EXPECT_GT(costs.modelBytes, 4 * 300);
}

TEST(MethodCosts, OfBlocksThatAreTrainedOneAfterAnotherGrowInTimeAlone) {
  Method alone = method();
  alone.partsAlone = true;
  const MethodCosts together = costsOnCapture(method(), flight(10, 8, 20, 60), 0);
  const MethodCosts costs = costsOnCapture(alone, flight(10, 8, 20, 60), 0);
  EXPECT_EQ(costs.trainBytes, 500);
  EXPECT_NEAR(costs.secondsPerStep, 0.1 * together.bakeSeconds / 10, 1e-9);
}

TEST(MethodCosts, AreThoseOfOneBlockWithoutPhotosOrBlocks) {
  EXPECT_EQ(costsOnCapture(method(), Capture{}, 0).modelBytes, 300);
  Method whole = method();
  whole.blockDemand = nullptr;
  EXPECT_EQ(costsOnCapture(whole, flight(10, 8, 20, 60), 0).modelBytes, 300);
}

}  // namespace
}  // namespace tessera
