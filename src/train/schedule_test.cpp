#include "train/schedule.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

RateSchedule schedule() {
  RateSchedule rates;
  rates.rate = 0.5;
  rates.finalFactor = 0.01;
  rates.constantFraction = 0.4;
  rates.warmUpSteps = 9;
  return rates;
}

TEST(RateSchedule, WarmsUpInEqualSteps) {
  EXPECT_NEAR(schedule().at(0, 1000), 0.05, 1e-12);
  EXPECT_NEAR(schedule().at(4, 1000), 0.25, 1e-12);
  EXPECT_NEAR(schedule().at(9, 1000), 0.5, 1e-12);
}

TEST(RateSchedule, IsConstantAndThenDecaysToItsFinalFactor) {
  EXPECT_NEAR(schedule().at(400, 1000), 0.5, 1e-12);
  EXPECT_NEAR(schedule().at(700, 1000), 0.05, 1e-12);  // the middle of the decay on a logarithmic scale
  EXPECT_NEAR(schedule().at(1000, 1000), 0.005, 1e-12);
  for (int64_t step = 10; step < 1000; ++step) EXPECT_LE(schedule().at(step + 1, 1000), schedule().at(step, 1000));
}

TEST(RateSchedule, DoesNotFallWhileTheNumberOfStepsIsUnknown) {
  EXPECT_EQ(schedule().at(1000000, 0), 0.5);
}

// See the invariants of NGP-RT in docs/invariants.md, number 12.
TEST(RateSchedule, RisesAndFallsLinearlyAsInNgpRt) {
  RateSchedule paper;
  paper.rate = 0.01;
  paper.warmUpSteps = 1000;
  paper.linear = true;
  EXPECT_EQ(paper.at(0, 100000), 0);
  EXPECT_NEAR(paper.at(500, 100000), 0.005, 1e-12);
  EXPECT_NEAR(paper.at(1000, 100000), 0.01, 1e-12);
  EXPECT_NEAR(paper.at(50500, 100000), 0.005, 1e-12);
  EXPECT_EQ(paper.at(100000, 100000), 0);
  EXPECT_EQ(paper.at(5000, 0), 0.01) << "the number of steps is unknown";
  EXPECT_GT(paper.at(400, 500), 0) << "training shorter than the warm-up";
}

// Simulates steps of `perStep` seconds until the number of steps is determined, and returns it.
int64_t countPlannedSteps(StepBudget budget, double perStep, double slowStart, int64_t* toldAt) {
  for (int64_t step = 1; step < 1000000; ++step) {
    const double seconds = slowStart + static_cast<double>(step) * perStep;
    if (const int64_t steps = budget.observe(step, seconds); steps != 0) {
      *toldAt = step;
      return steps;
    }
  }
  return 0;
}

TEST(StepBudget, FixesTheStepsWhileTheScheduleIsStillConstant) {
  int64_t toldAt = 0;
  const int64_t steps = countPlannedSteps(StepBudget(10), 0.05, 0, &toldAt);
  EXPECT_NEAR(static_cast<double>(steps), 12000, 5);
  EXPECT_LT(static_cast<double>(toldAt), static_cast<double>(steps) * RateSchedule().constantFraction);
}

TEST(StepBudget, CountsASlowStartTowardsTheTimeButNotTheSpeed) {
  int64_t toldAt = 0;
  EXPECT_NEAR(static_cast<double>(countPlannedSteps(StepBudget(10), 0.05, 100, &toldAt)), 10000, 5);
}

// A checkpoint of 8 s every 68 s, one of them within the time in which the speed is measured.
TEST(StepBudget, CountsCheckpointsByTheirShareOfTheTime) {
  StepBudget budget(10);
  int64_t planned = 0, step = 0;
  double seconds = 0, saving = 0, nextSave = 60;
  while (planned == 0 || step < planned) {
    seconds += 0.15;
    ++step;
    if (planned == 0) planned = budget.observe(step, seconds, saving, 8.0 / 68);
    if (seconds < nextSave) continue;
    seconds += 8;
    saving += 8;
    nextSave = seconds + 60;
  }
  EXPECT_NEAR(seconds, 600, 15);
}

TEST(StepBudget, WaitsForEnoughStepsEvenWhenTimeIsShort) {
  int64_t toldAt = 0;
  const int64_t steps = countPlannedSteps(StepBudget(0.001), 0.05, 0, &toldAt);
  EXPECT_GE(toldAt, 16);
  EXPECT_EQ(steps, toldAt);  // no time is left
}

}  // namespace
}  // namespace tessera
