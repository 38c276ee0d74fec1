#include "compute/roofline.h"

#include <gtest/gtest.h>

#include <set>

namespace tessera {
namespace {

TEST(Roofline, HasARowForEveryOperation) {
  RooflineOptions options;
  options.device.kind = "reference";
  options.samples = {64};
  options.streamed = 128;
  options.secondsPerRow = 0;
  const Roofline roofline = measureRoofline(options);
  std::set<Operation> measured;
  for (const RooflineRow& row : roofline.rows) {
    EXPECT_GT(row.rate, 0) << row.name;
    measured.insert(row.operation);
  }
  EXPECT_EQ(measured.size(), std::size(kOperationNames));
}

TEST(Roofline, LinesUpRayLikePositions) {
  const std::vector<float> points = rayLikePositions(3, 8, 1);
  ASSERT_EQ(points.size(), 3u * 8 * 3);
  EXPECT_EQ(points, rayLikePositions(3, 8, 1));
  for (const float value : points) EXPECT_TRUE(value >= 0 && value <= 1) << value;
  EXPECT_NE(points, rayLikePositions(3, 8, 2));
}

}  // namespace
}  // namespace tessera
