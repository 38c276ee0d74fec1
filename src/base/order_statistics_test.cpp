#include "base/order_statistics.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(OrderStatistics, CountTheValuesBelow) {
  std::vector<int> values = {7, 3, 9, 1, 5, 3};
  EXPECT_EQ(valueOfRank(values, 0), 1);
  EXPECT_EQ(valueOfRank(values, 2), 3);
  EXPECT_EQ(valueOfRank(values, 5), 9);
  EXPECT_EQ(values.size(), 6u);
}

TEST(OrderStatistics, TakeTheLargerOfTwoMedians) {
  std::vector<float> four = {4, 1, 3, 2}, five = {5, 4, 1, 3, 2}, one = {6};
  EXPECT_EQ(upperMedian(four), 3);
  EXPECT_EQ(upperMedian(five), 3);
  EXPECT_EQ(upperMedian(one), 6);
}

TEST(OrderStatistics, RoundPercentilesDown) {
  std::vector<double> values = {4, 1, 3, 2};
  EXPECT_EQ(percentile(values, 0), 1);
  EXPECT_EQ(percentile(values, 0.5), 2);
  EXPECT_EQ(percentile(values, 0.99), 3);
  EXPECT_EQ(percentile(values, 1), 4);
}

TEST(OrderStatisticsDeathTest, NeedValues) {
  std::vector<float> none;
  EXPECT_DEATH(upperMedian(none), "rank");
  EXPECT_DEATH(percentile(none, 0.5), "values");
}

}  // namespace
}  // namespace tessera
