#include "compute/rays.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tessera {
namespace {

TEST(MarchSpace, StepIndexAndDistanceAreInverse) {
  for (const MarchSpace& space : {MarchSpace{}, MarchSpace{.minStep = 0.02f, .maxStep = 0.1f, .cone = 0.02f},
                                  MarchSpace{.minStep = 0.01f, .cone = 0}})
    for (double t = 0; t < 50; t += 0.37) {
      EXPECT_NEAR(space.distanceAt(space.stepIndex(t)), t, 1e-9 * (1 + t));
    }
}

TEST(MarchSpace, GrowsStepsByTheConeFromMinStepToMaxStep) {
  const MarchSpace space{.minStep = 0.02f, .maxStep = 0.1f, .cone = 0.02f};
  double last = 0;
  for (int n = 0; n < 400; ++n) {
    const double t = space.distanceAt(n), step = space.distanceAt(n + 1) - t;
    EXPECT_GE(step, space.minStep * (1 - 1e-9));
    EXPECT_LE(step, space.maxStep * (1 + 1e-9));
    EXPECT_GE(step, last * (1 - 1e-9));
    if (t > 1.1 && t < 4.8) {
      EXPECT_NEAR(step / t, space.cone, 1e-9);
    }
    last = step;
  }
  EXPECT_NEAR(last, space.maxStep, 1e-9);
}

TEST(MarchSpace, TakesUniformStepsWithoutACone) {
  const MarchSpace space{.minStep = 0.25f, .cone = 0};
  EXPECT_EQ(space.distanceAt(7), 1.75);
  EXPECT_EQ(space.stepIndex(1.75), 7);
}

}  // namespace
}  // namespace tessera
