#include "train/ray_budget.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace tessera {
namespace {

RaySettings settings(int first, int maximum) {
  RaySettings rays;
  rays.firstRays = first;
  rays.maxRays = maximum;
  return rays;
}

TEST(RayBudget, StaysWithinItsBounds) {
  RayBudget budget(settings(100, 1000));
  EXPECT_EQ(budget.rays(), 100u);
  budget.aimFor(2000);
  EXPECT_EQ(budget.rays(), 1000u);
  budget.aimFor(0.5);
  EXPECT_EQ(budget.rays(), 8u);
}

TEST(RayBudget, KeepsWholeGroups) {
  RayBudget budget(settings(100, 1000), 16);
  EXPECT_EQ(budget.rays(), 96u);
  budget.aimFor(2000);
  EXPECT_EQ(budget.rays(), 992u);
  budget.aimFor(0);
  EXPECT_EQ(budget.rays(), 16u);
}

TEST(RayBudget, RetriesWithFewerRaysUntilTheyFit) {
  RayBudget budget(settings(1000, 1000));
  EXPECT_FALSE(budget.drawsFewer(10, 10));
  EXPECT_EQ(budget.rays(), 1000u);
  EXPECT_TRUE(budget.drawsFewer(20, 10));
  EXPECT_EQ(budget.rays(), 450u);
  RayBudget groups(settings(992, 1000), 16);
  EXPECT_TRUE(groups.drawsFewer(20, 10));
  EXPECT_EQ(groups.rays(), 432u);  // 446.4 in groups of 16
}

TEST(RayBudget, GivesUpAtOneGroup) {
  for (const uint32_t group : {1u, 16u}) {
    RayBudget budget(settings(64, 64), group);
    EXPECT_TRUE(budget.drawsFewer(1e9, 1));
    EXPECT_EQ(budget.rays(), group);
    EXPECT_FALSE(budget.canShrink());
    EXPECT_FALSE(budget.drawsFewer(1e9, 1));
  }
}

class RayBudgetCheckpoint : public testing::Test {
 protected:
  ~RayBudgetCheckpoint() override { fs::remove(path_); }
  Safetensors holding(std::vector<uint32_t> rays) {
    TensorSet tensors;
    tensors.add("rays", std::move(rays));
    writeFileAtomically(path_, tensors.encode({}));
    return readSafetensors(path_);
  }
  const fs::path path_ = fs::temp_directory_path() / "tessera-ray-budget.safetensors";
};

TEST_F(RayBudgetCheckpoint, IsRestoredWithinItsBounds) {
  RayBudget budget(settings(64, 1000), 16);
  budget.restore(path_, holding({320}));
  EXPECT_EQ(budget.rays(), 320u);
  budget.restore(path_, holding({5000}));
  EXPECT_EQ(budget.rays(), 992u);
  budget.restore(path_, holding({0}));
  EXPECT_EQ(budget.rays(), 16u);
  EXPECT_THROW(budget.restore(path_, holding({1, 2})), Error);
}

}  // namespace
}  // namespace tessera
