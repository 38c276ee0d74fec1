#include "raymarch/bake/part_summary.h"

#include <gtest/gtest.h>

#include "representations/hash/testing/random_content.h"
#include "representations/volume/testing/random_content.h"

namespace tessera {
namespace {

TEST(PartSummary, CoversAllPartsAndReportsTheEdgeOfATexel) {
  HashContent content = tiles_test::testHashContent(3, 2);
  content.parts[0].low = {-2, -1, -1};
  content.parts[0].high = {0, 1, 0.5f};
  content.parts[1].low = {0, -1, -0.5f};
  content.parts[1].high = {2, 3, 1};
  for (HashPart& part : content.parts) part.contracted = false;
  const ContentSummary summary = partSummary(content, 64);
  EXPECT_EQ(summary.box.low, Vec3d(-2, -1, -1));
  EXPECT_EQ(summary.box.high, Vec3d(2, 3, 1));
  EXPECT_FALSE(summary.isBackground);
  EXPECT_EQ(summary.geometricError, 2.0 / 64);
  EXPECT_EQ(summary.memoryBytes, bytesInMemory(content));
  const uint64_t macroblocks = content.parts[0].storedMacroblocks() + content.parts[1].storedMacroblocks();
  EXPECT_EQ(summary.counts, (decltype(ContentSummary::counts){{"macroblocks", macroblocks}}));
}

TEST(PartSummary, ReportsTheEdgeOfABackgroundsSmallestTexel) {
  VolumeContent content = tiles_test::testContent(5);
  VolumePart& part = content.parts[0];
  part.backgroundBlock = part.contracted = true;
  part.scale = {2, 1, 1.5f};
  const ContentSummary summary = partSummary(content, 32);
  EXPECT_TRUE(summary.isBackground);
  EXPECT_EQ(summary.geometricError, 2 * 4.0 / 32);
  EXPECT_EQ(summary.memoryBytes, bytesInMemory(content));
}

// Of blocks at the border that also show what lies outside of the grid.
TEST(PartSummary, ReportsTheEdgeOfATexelOfTheCoarsestPart) {
  HashContent content = tiles_test::testHashContent(3, 2);
  for (HashPart& part : content.parts) {
    part.backgroundBlock = false;
    part.scale = {1, 1, 1};
  }
  content.parts[0].contracted = false;
  content.parts[1].contracted = true;
  const ContentSummary summary = partSummary(content, 64);
  EXPECT_FALSE(summary.isBackground);
  EXPECT_EQ(summary.geometricError, 4.0 / 64);
}

}  // namespace
}  // namespace tessera
