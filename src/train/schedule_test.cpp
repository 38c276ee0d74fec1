#include "train/schedule.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

RateSchedule schedule() {
  RateSchedule made;
  made.rate = 0.5;
  made.finalFactor = 0.01;
  made.constantFraction = 0.4;
  made.warmUpSteps = 9;
  return made;
}

TEST(RateSchedule, WarmsUpInEqualSteps) {
  EXPECT_NEAR(schedule().at(0, 1000), 0.05, 1e-12);
  EXPECT_NEAR(schedule().at(4, 1000), 0.25, 1e-12);
  EXPECT_NEAR(schedule().at(9, 1000), 0.5, 1e-12);
}

TEST(RateSchedule, IsConstantAndThenFallsToItsEnd) {
  EXPECT_NEAR(schedule().at(400, 1000), 0.5, 1e-12);
  EXPECT_NEAR(schedule().at(700, 1000), 0.05, 1e-12);  // half way down, in logarithms
  EXPECT_NEAR(schedule().at(1000, 1000), 0.005, 1e-12);
  for (int64_t step = 10; step < 1000; ++step) EXPECT_LE(schedule().at(step + 1, 1000), schedule().at(step, 1000));
}

TEST(RateSchedule, DoesNotFallWhileTheNumberOfStepsIsUnknown) {
  EXPECT_EQ(schedule().at(1000000, 0), 0.5);
}

// Invariant 12 of NGP-RT.
TEST(RateSchedule, RisesAndFallsInLinesWhereItIsThePapers) {
  RateSchedule paper;
  paper.rate = 0.01;
  paper.warmUpSteps = 1000;
  paper.linear = true;
  EXPECT_EQ(paper.at(0, 100000), 0);
  EXPECT_NEAR(paper.at(500, 100000), 0.005, 1e-12);
  EXPECT_NEAR(paper.at(1000, 100000), 0.01, 1e-12);
  EXPECT_NEAR(paper.at(50500, 100000), 0.005, 1e-12);
  EXPECT_EQ(paper.at(100000, 100000), 0);
  EXPECT_EQ(paper.at(5000, 0), 0.01) << "nobody knows yet how far it is";
  EXPECT_GT(paper.at(400, 500), 0) << "a short training";
}

// Steps that take `perStep` seconds, until the number of steps is told.
int64_t stepsOf(StepBudget budget, double perStep, double slowStart, int64_t* toldAt) {
  for (int64_t step = 1; step < 1000000; ++step) {
    const double seconds = slowStart + static_cast<double>(step) * perStep;
    if (const int64_t steps = budget.observe(step, seconds); steps != 0) {
      *toldAt = step;
      return steps;
    }
  }
  return 0;
}

TEST(StepBudget, TellsHowManyStepsFitWhileTheScheduleIsStillConstant) {
  int64_t toldAt = 0;
  const int64_t steps = stepsOf(StepBudget(10), 0.05, 0, &toldAt);
  EXPECT_NEAR(static_cast<double>(steps), 12000, 5);
  EXPECT_LT(static_cast<double>(toldAt), static_cast<double>(steps) * RateSchedule().constantFraction);
}

TEST(StepBudget, CountsASlowStartAgainstTheTimeButNotThePace) {
  int64_t toldAt = 0;
  EXPECT_NEAR(static_cast<double>(stepsOf(StepBudget(10), 0.05, 100, &toldAt)), 10000, 5);
}

TEST(StepBudget, WaitsForEnoughStepsEvenWhenTimeIsShort) {
  int64_t toldAt = 0;
  const int64_t steps = stepsOf(StepBudget(0.001), 0.05, 0, &toldAt);
  EXPECT_GE(toldAt, 16);
  EXPECT_EQ(steps, toldAt);  // the time is over
}

}  // namespace
}  // namespace tessera
