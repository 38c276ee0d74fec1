#include "apps/viewer/dynamic_resolution.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

// Simulates frames on a machine that takes `whole` milliseconds for all pixels, and never less than `minimum`.
void draw(DynamicResolution& resolution, int pictures, double whole, double minimum = 0) {
  for (int i = 0; i < pictures; ++i)
    resolution.took(std::max(minimum, whole * resolution.share() * resolution.share()));
}

TEST(DynamicResolution, DrawsAllPixelsWhereTheyComeInTime) {
  DynamicResolution resolution(40);
  draw(resolution, 1000, 20);
  EXPECT_EQ(resolution.share(), 1);
}

TEST(DynamicResolution, DrawsFewerPixelsWhereTheyDoNotComeInTime) {
  DynamicResolution resolution(40);
  draw(resolution, 10, 150);
  EXPECT_EQ(resolution.share(), 0.5);
  draw(resolution, 10, 10000);
  EXPECT_EQ(resolution.share(), 0.125);
}

TEST(DynamicResolution, MayBeginWithFewPixels) {
  DynamicResolution resolution(40, DynamicResolution::Begin::few);
  EXPECT_EQ(resolution.share(), 0.125);
  draw(resolution, 20, 5);
  EXPECT_EQ(resolution.share(), 1);
}

TEST(DynamicResolution, ComesBackWhenTheMachineIsFreeAgain) {
  DynamicResolution resolution(40);
  draw(resolution, 10, 10000);
  EXPECT_EQ(resolution.share(), 0.125);
  draw(resolution, 20, 10);
  EXPECT_EQ(resolution.share(), 1);
}

TEST(DynamicResolution, TriesMorePixelsWhereTheRefreshRateHidesTheirCost) {
  DynamicResolution resolution(20);
  draw(resolution, 10, 2000, 16);
  EXPECT_EQ(resolution.share(), 0.125);
  draw(resolution, 1000, 5, 16);
  EXPECT_EQ(resolution.share(), 1);
}

TEST(DynamicResolution, RarelyRetriesAResolutionThatWasTooSlow) {
  DynamicResolution resolution(20);
  draw(resolution, 10, 60, 16);
  const double fits = resolution.share();
  int wider = 0;
  for (int i = 0; i < 4000; ++i) {
    draw(resolution, 1, 60, 16);
    wider += resolution.share() > fits;
  }
  EXPECT_GT(wider, 0);
  EXPECT_LT(wider, 60);
}

}  // namespace
}  // namespace tessera
