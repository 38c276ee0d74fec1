#include "apps/viewer/pace.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

// So many pictures by a machine that takes so long for all pixels, and never less than `least`.
void draw(Pace& pace, int pictures, double whole, double least = 0) {
  for (int i = 0; i < pictures; ++i) pace.took(std::max(least, whole * pace.share() * pace.share()));
}

TEST(Pace, DrawsAllPixelsWhereTheyComeInTime) {
  Pace pace(40);
  draw(pace, 1000, 20);
  EXPECT_EQ(pace.share(), 1);
}

TEST(Pace, DrawsFewerWhereTheyDoNot) {
  Pace pace(40);
  draw(pace, 10, 150);
  EXPECT_EQ(pace.share(), 0.5);
  draw(pace, 10, 10000);
  EXPECT_EQ(pace.share(), 0.125);
}

TEST(Pace, MayBeginWithFewPixels) {
  Pace pace(40, Pace::Begin::few);
  EXPECT_EQ(pace.share(), 0.125);
  draw(pace, 20, 5);
  EXPECT_EQ(pace.share(), 1);
}

TEST(Pace, ComesBackWhenTheMachineIsFreeAgain) {
  Pace pace(40);
  draw(pace, 10, 10000);
  EXPECT_EQ(pace.share(), 0.125);
  draw(pace, 20, 10);
  EXPECT_EQ(pace.share(), 1);
}

TEST(Pace, TriesMorePixelsWhereAScreenHidesWhatTheyTake) {
  Pace pace(20);
  draw(pace, 10, 2000, 16);
  EXPECT_EQ(pace.share(), 0.125);
  draw(pace, 1000, 5, 16);
  EXPECT_EQ(pace.share(), 1);
}

TEST(Pace, TriesSeldomWhatFailedBefore) {
  Pace pace(20);
  draw(pace, 10, 60, 16);
  const double fits = pace.share();
  int wider = 0;
  for (int i = 0; i < 4000; ++i) {
    draw(pace, 1, 60, 16);
    wider += pace.share() > fits;
  }
  EXPECT_GT(wider, 0);
  EXPECT_LT(wider, 60);
}

}  // namespace
}  // namespace tessera
