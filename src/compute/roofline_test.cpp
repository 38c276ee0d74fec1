#include "compute/roofline.h"

#include <gtest/gtest.h>

#include <set>

#include "compute/operations.h"
#ifdef TESSERA_HAS_VULKAN
#include "gpu/testing/test_context.h"
#endif

namespace tessera {
namespace {

TEST(Roofline, HasARowForEveryOperation) {
  RooflineOptions options;
  options.device.kind = "reference";
  options.samples = {64};
  options.streamed = 128;
  options.secondsPerRow = 0;
  const Roofline roofline = measureRoofline(options);
  std::set<OperationId> measured;
  for (const RooflineRow& row : roofline.rows) {
    EXPECT_GT(row.rate, 0) << row.name;
    measured.insert(row.operation);
  }
  EXPECT_EQ(measured.size(), std::size(kAllOperations));
}

#ifdef TESSERA_HAS_VULKAN
TEST(Roofline, ComparesEveryOperationOfAGpuWithItsLimits) {
  SKIP_WITHOUT_VULKAN(openForTest());
  RooflineOptions options;
  options.device.kind = "vulkan";
  options.samples = {256};
  options.streamed = 512;
  options.secondsPerRow = 0;
  const Roofline roofline = measureRoofline(options);
  EXPECT_GT(roofline.limits.flops, 1e8);
  EXPECT_FALSE(roofline.limits.streams.empty());
  for (const MachineLimits::Stream& stream : roofline.limits.streams) EXPECT_GT(stream.rate, 1e7) << stream.bytes;
  for (const MachineLimits::Gather& gather : roofline.limits.gathers)
    EXPECT_GT(gather.lookups, 1e5) << gather.tableBytes;
  std::set<OperationId> measured;
  for (const RooflineRow& row : roofline.rows) {
    EXPECT_GT(row.limit, 0) << row.name;
    EXPECT_EQ(row.memoryLimit > 0, row.name.starts_with("Mlp")) << row.name;
    EXPECT_GE(row.shareOfBoth(), row.share()) << row.name;
    measured.insert(row.operation);
  }
  EXPECT_EQ(measured.size(), std::size(kAllOperations));
  EXPECT_EQ(GpuContext::validationMessages(), 0);
}
#endif

TEST(Roofline, LinesUpRayLikePositions) {
  const std::vector<float> points = rayLikePositions(3, 8, 1);
  ASSERT_EQ(points.size(), 3u * 8 * 3);
  EXPECT_EQ(points, rayLikePositions(3, 8, 1));
  for (const float value : points) EXPECT_TRUE(value >= 0 && value <= 1) << value;
  EXPECT_NE(points, rayLikePositions(3, 8, 2));
}

}  // namespace
}  // namespace tessera
