#include "representations/mesh/train/mesh_schedule.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

TEST(MeshSchedule, IsThatOfThePaper) {
  struct Row {
    int64_t step;
    double threshold, firstWeight;
  };
  constexpr Row kRows[] = {{0, 0, 1},
                           {9999, 0, 1},
                           {10000, 0, 0.8},
                           {20000, 0.012, 0.64},
                           {30000, 0.048, 0.512},
                           {40000, 0.108, 0.4096},
                           {50000, 0.192, 0.32768},
                           {60000, 0.3, 0.262144},
                           {70000, 0.3, 0.2097152},
                           {79999, 0.3, 0.2097152}};
  for (const Row& row : kRows) {
    EXPECT_NEAR(MeshSchedule::threshold(row.step, 80000), row.threshold, 1e-12) << row.step;
    EXPECT_NEAR(MeshSchedule::firstWeight(row.step, 80000), row.firstWeight, 1e-12) << row.step;
    // A hundredth of the steps; the last step of a period may belong to the next one.
    if (row.step % 10000 != 0) continue;
    EXPECT_NEAR(MeshSchedule::threshold(row.step / 100, 800), row.threshold, 1e-12) << row.step;
    EXPECT_NEAR(MeshSchedule::firstWeight(row.step / 100, 800), row.firstWeight, 1e-12) << row.step;
  }
  EXPECT_EQ(MeshSchedule::firstWeight(500, 0), 1) << "the number of steps is unknown";
}

}  // namespace
}  // namespace tessera
