#include "eval/depth_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tessera {
namespace {

TEST(DepthError, ComputesTheFourMeasures) {
  ImageF depth(4, 1, 1), opacity(4, 1, 1, 1.0f), reference(4, 1, 1);
  reference.pixels = {10, 10, 10, 10};
  depth.pixels = {10, 11, 8, 20};
  const auto error = depthError(depth, opacity, reference);
  ASSERT_TRUE(error);
  EXPECT_NEAR(error->absoluteRelative, (0 + 0.1 + 0.2 + 1) / 4, 1e-9);
  EXPECT_NEAR(error->rootMeanSquare, std::sqrt((0 + 1 + 4 + 100) / 4.0), 1e-9);
  EXPECT_NEAR(error->medianAbsolute, 1.5, 1e-6);
  EXPECT_NEAR(error->within125, 0.5, 1e-9);  // 10/8 is not below 1.25
  EXPECT_EQ(error->pixels, 4u);
}

TEST(DepthError, DividesByOpacityAndCountsHolesAsWrong) {
  ImageF depth(2, 1, 1), opacity(2, 1, 1), reference(2, 1, 1, 4.0f);
  depth.pixels = {2, 0};
  opacity.pixels = {0.5f, 0};
  const auto error = depthError(depth, opacity, reference);
  ASSERT_TRUE(error);
  EXPECT_NEAR(error->absoluteRelative, 0.5, 1e-9);
  EXPECT_NEAR(error->within125, 0.5, 1e-9);
}

TEST(DepthError, IgnoresPixelsWithoutAReference) {
  ImageF depth(5, 1, 1, 3.0f), opacity(5, 1, 1, 1.0f), reference(5, 1, 1);
  reference.pixels = {0, -1, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 3};
  EXPECT_EQ(depthError(depth, opacity, reference)->pixels, 1u);
  EXPECT_EQ(depthError(depth, opacity, reference)->rootMeanSquare, 0.0);
  ImageU8 mask(5, 1, 1, 255);
  mask.pixels[4] = 0;
  EXPECT_FALSE(depthError(depth, opacity, reference, &mask));
}

TEST(DepthError, SamplesTheNearestPixelOfALargerMap) {
  ImageF reference(6, 3, 1, 100.0f);
  reference.at(1, 1)[0] = 5;
  reference.at(4, 1)[0] = 7;
  const ImageF small = resampledToNearest(reference, 2, 1);
  EXPECT_EQ(small.pixels, (std::vector<float>{5, 7}));
  const ImageF large = resampledToNearest(small, 4, 1);
  EXPECT_EQ(large.pixels, (std::vector<float>{5, 5, 7, 7}));
}

}  // namespace
}  // namespace tessera
