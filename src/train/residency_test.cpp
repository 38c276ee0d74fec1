#include "train/residency.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

bool holds(const std::vector<uint32_t>& blocks, const std::vector<uint32_t>& set) {
  return std::includes(blocks.begin(), blocks.end(), set.begin(), set.end());
}

// 4 × 4 blocks: most rays cross one, some two neighbours, few three in a row, and some only the background block.
BlockSets city() {
  BlockSets sets;
  const auto add = [&](std::vector<uint32_t> set, double weight) {
    std::sort(set.begin(), set.end());
    sets.sets.push_back(set);
    sets.weights.push_back(weight);
  };
  add({}, 50);
  for (uint32_t j = 0; j < 4; ++j) {
    for (uint32_t i = 0; i < 4; ++i) {
      const uint32_t block = i + 4 * j;
      add({block}, 100 + block);
      if (i < 3) add({block, block + 1}, 20 + i);
      if (j < 3) add({block, block + 4}, 20 + j);
      if (i < 2) add({block, block + 1, block + 2}, 3);
    }
  }
  return sets;
}

TEST(Residency, ServesEverySetThatFitsAndReportsTheUnservedShare) {
  BlockSets sets = city();
  double total = 0;
  for (const double weight : sets.weights) total += weight;
  const Residency all(sets, {16, 4, 1000, 1});
  EXPECT_LT(all.unserved(), Residency::kForgone);
  for (const Residency::ResidentSet& residentSet : all.residentSets()) {
    EXPECT_EQ(residentSet.blocks.size(), 4u);
    EXPECT_TRUE(std::is_sorted(residentSet.blocks.begin(), residentSet.blocks.end()));
    EXPECT_EQ(std::adjacent_find(residentSet.blocks.begin(), residentSet.blocks.end()), residentSet.blocks.end());
    EXPECT_LT(residentSet.blocks.back(), 16u);
    ASSERT_EQ(residentSet.shareOfSet.size(), sets.sets.size());
    for (size_t i = 0; i < sets.sets.size(); ++i) {
      EXPECT_EQ(residentSet.shareOfSet[i] > 0, holds(residentSet.blocks, sets.sets[i]));
    }
  }
  sets.sets.push_back({0, 1, 2, 3, 4});
  sets.weights.push_back(total / 9);
  EXPECT_NEAR(Residency(sets, {16, 4, 1000, 1}).unserved(), 0.1, Residency::kForgone);
}

TEST(Residency, MakesEveryBlockOfASetThatFitsResidentHoweverRare) {
  BlockSets sets = city();
  for (uint32_t block : {16u, 17u}) {
    sets.sets.push_back({0, block});
    sets.weights.push_back(1e-6);
  }
  sets.sets.push_back({0, 1, 2, 4, 18});  // too large
  sets.weights.push_back(1);
  const Residency residency(sets, {20, 4, 1000, 1});
  const auto comesUp = [&](uint32_t block) {
    return std::any_of(residency.residentSets().begin(), residency.residentSets().end(),
                       [&](const Residency::ResidentSet& residentSet) { return holds(residentSet.blocks, {block}); });
  };
  for (uint32_t block = 0; block < 18; ++block) EXPECT_TRUE(comesUp(block)) << block;
  EXPECT_EQ(residency.neverServed(), std::vector<uint32_t>{18}) << "no ray sees number 19";
}

TEST(Residency, DrawsFromEverySetInProportionToItsWeight) {
  const BlockSets sets = city();
  const Residency residency(sets, {16, 4, 100000, 1});
  std::vector<double> drawn(sets.sets.size());
  double total = 0;
  for (const Residency::ResidentSet& residentSet : residency.residentSets()) {
    double sum = 0;
    for (size_t i = 0; i < drawn.size(); ++i) sum += sets.weights[i] * residentSet.shareOfSet[i];
    for (size_t i = 0; i < drawn.size(); ++i) {
      drawn[i] += static_cast<double>(residentSet.steps) * sets.weights[i] * residentSet.shareOfSet[i] / sum;
    }
  }
  double all = 0;
  for (size_t i = 0; i < drawn.size(); ++i) {
    all += sets.weights[i];
    total += drawn[i] > 0 ? sets.weights[i] : 0;
  }
  EXPECT_NEAR(1 - total / all, residency.unserved(), 1e-9) << "all sets are drawn but those that are reported";
  EXPECT_GT(total, 0.5 * all);
  for (size_t i = 0; i < drawn.size(); ++i) {
    if (drawn[i] == 0) continue;
    EXPECT_NEAR(drawn[i] / static_cast<double>(residency.cycleSteps()), sets.weights[i] / total,
                0.01 * sets.weights[i] / total);
  }
}

TEST(Residency, VisitsEveryResidentSetOncePerCycleInANewOrder) {
  const Residency residency(city(), {16, 4, 400, 7});
  std::vector<std::vector<size_t>> orders;
  for (int64_t cycle = 0; cycle < 3; ++cycle) {
    std::vector<size_t> order;
    std::vector<int64_t> steps(residency.residentSets().size());
    for (int64_t step = cycle * residency.cycleSteps(); step < (cycle + 1) * residency.cycleSteps(); ++step) {
      const Residency::Position position = residency.at(step);
      EXPECT_EQ(position.stepsInto, steps[position.residentSet]++);
      if (order.empty() || order.back() != position.residentSet) order.push_back(position.residentSet);
    }
    EXPECT_EQ(order.size(), residency.residentSets().size());
    for (size_t i = 0; i < steps.size(); ++i) EXPECT_EQ(steps[i], residency.residentSets()[i].steps);
    orders.push_back(order);
  }
  EXPECT_NE(orders[0], orders[1]);
  EXPECT_NE(orders[1], orders[2]);
}

TEST(Residency, FillsResidentSetsEvenWithoutRays) {
  const Residency nothing({}, {5, 2, 10, 1});
  ASSERT_EQ(nothing.residentSets().size(), 1u);
  EXPECT_EQ(nothing.residentSets()[0].blocks.size(), 2u);
  EXPECT_EQ(nothing.unserved(), 0);
  const Residency one({{{3}}, {1}}, {5, 5, 10, 1});
  ASSERT_EQ(one.residentSets().size(), 1u);
  EXPECT_EQ(one.residentSets()[0].blocks.size(), 5u);
  EXPECT_EQ(one.cycleSteps(), 10);
}

TEST(Residency, GivesEveryResidentSetAtLeastOneStep) {
  const Residency residency(city(), {16, 4, 1, 1});
  EXPECT_EQ(residency.cycleSteps(), static_cast<int64_t>(residency.residentSets().size()));
}

}  // namespace
}  // namespace tessera
