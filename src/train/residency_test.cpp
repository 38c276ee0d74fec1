#include "train/residency.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

bool holds(const std::vector<uint32_t>& blocks, const std::vector<uint32_t>& set) {
  return std::includes(blocks.begin(), blocks.end(), set.begin(), set.end());
}

// 4 × 4 blocks: most rays see one, some two neighbours, few three in a row, and some nothing but the surround.
BlockSets city() {
  BlockSets made;
  const auto add = [&](std::vector<uint32_t> set, double weight) {
    std::sort(set.begin(), set.end());
    made.sets.push_back(set);
    made.weights.push_back(weight);
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
  return made;
}

TEST(Residency, ServesEverySetThatFitsAndSaysWhatDoesNot) {
  BlockSets sets = city();
  double total = 0;
  for (const double weight : sets.weights) total += weight;
  const Residency all(sets, {16, 4, 1000, 1});
  EXPECT_LT(all.unserved(), Residency::kForgone);
  for (const Residency::Stay& stay : all.stays()) {
    EXPECT_EQ(stay.blocks.size(), 4u);
    EXPECT_TRUE(std::is_sorted(stay.blocks.begin(), stay.blocks.end()));
    EXPECT_EQ(std::adjacent_find(stay.blocks.begin(), stay.blocks.end()), stay.blocks.end());
    EXPECT_LT(stay.blocks.back(), 16u);
    ASSERT_EQ(stay.shareOfSet.size(), sets.sets.size());
    for (size_t i = 0; i < sets.sets.size(); ++i) {
      EXPECT_EQ(stay.shareOfSet[i] > 0, holds(stay.blocks, sets.sets[i]));
    }
  }
  sets.sets.push_back({0, 1, 2, 3, 4});
  sets.weights.push_back(total / 9);
  EXPECT_NEAR(Residency(sets, {16, 4, 1000, 1}).unserved(), 0.1, Residency::kForgone);
}

TEST(Residency, BringsEveryBlockThatASetThatFitsAsksForHoweverRare) {
  BlockSets sets = city();
  for (uint32_t block : {16u, 17u}) {
    sets.sets.push_back({0, block});
    sets.weights.push_back(1e-6);
  }
  sets.sets.push_back({0, 1, 2, 4, 18});  // too many
  sets.weights.push_back(1);
  const Residency residency(sets, {20, 4, 1000, 1});
  const auto comesUp = [&](uint32_t block) {
    return std::any_of(residency.stays().begin(), residency.stays().end(),
                       [&](const Residency::Stay& stay) { return holds(stay.blocks, {block}); });
  };
  for (uint32_t block = 0; block < 18; ++block) EXPECT_TRUE(comesUp(block)) << block;
  EXPECT_EQ(residency.neverServed(), std::vector<uint32_t>{18}) << "no ray sees number 19";
}

TEST(Residency, DrawsFromEverySetAsOftenAsItsWeightAsks) {
  const BlockSets sets = city();
  const Residency residency(sets, {16, 4, 100000, 1});
  std::vector<double> drawn(sets.sets.size());
  double total = 0;
  for (const Residency::Stay& stay : residency.stays()) {
    double sum = 0;
    for (size_t i = 0; i < drawn.size(); ++i) sum += sets.weights[i] * stay.shareOfSet[i];
    for (size_t i = 0; i < drawn.size(); ++i) {
      drawn[i] += static_cast<double>(stay.steps) * sets.weights[i] * stay.shareOfSet[i] / sum;
    }
  }
  for (size_t i = 0; i < drawn.size(); ++i) total += drawn[i] > 0 ? sets.weights[i] : 0;
  for (size_t i = 0; i < drawn.size(); ++i) {
    if (drawn[i] == 0) continue;
    EXPECT_NEAR(drawn[i] / static_cast<double>(residency.cycleSteps()), sets.weights[i] / total,
                0.01 * sets.weights[i] / total);
  }
}

TEST(Residency, HasEveryStayOnceACycleInAnOrderOfItsOwn) {
  const Residency residency(city(), {16, 4, 400, 7});
  std::vector<std::vector<size_t>> orders;
  for (int64_t cycle = 0; cycle < 3; ++cycle) {
    std::vector<size_t> order;
    std::vector<int64_t> steps(residency.stays().size());
    for (int64_t step = cycle * residency.cycleSteps(); step < (cycle + 1) * residency.cycleSteps(); ++step) {
      const Residency::Place place = residency.at(step);
      EXPECT_EQ(place.stepsInto, steps[place.stay]++);
      if (order.empty() || order.back() != place.stay) order.push_back(place.stay);
    }
    EXPECT_EQ(order.size(), residency.stays().size());
    for (size_t i = 0; i < steps.size(); ++i) EXPECT_EQ(steps[i], residency.stays()[i].steps);
    orders.push_back(order);
  }
  EXPECT_NE(orders[0], orders[1]);
  EXPECT_NE(orders[1], orders[2]);
}

TEST(Residency, HoldsBlocksEvenWhereNothingIsSeen) {
  const Residency nothing({}, {5, 2, 10, 1});
  ASSERT_EQ(nothing.stays().size(), 1u);
  EXPECT_EQ(nothing.stays()[0].blocks.size(), 2u);
  EXPECT_EQ(nothing.unserved(), 0);
  const Residency one({{{3}}, {1}}, {5, 5, 10, 1});
  ASSERT_EQ(one.stays().size(), 1u);
  EXPECT_EQ(one.stays()[0].blocks.size(), 5u);
  EXPECT_EQ(one.cycleSteps(), 10);
}

TEST(Residency, GivesEveryStayAStepHoweverShortTheCycle) {
  const Residency residency(city(), {16, 4, 1, 1});
  EXPECT_EQ(residency.cycleSteps(), static_cast<int64_t>(residency.stays().size()));
}

}  // namespace
}  // namespace tessera
