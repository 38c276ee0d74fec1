// For tests: checks that the payloads of every ray-marched representation have in common.
#pragma once

#include <gtest/gtest.h>

#include "raymarch/content/content_part.h"
#include "tiles/testing/content_refusal.h"

namespace tessera::tiles_test {

inline void expectSamePlace(const ContentPart& one, const ContentPart& other) {
  EXPECT_EQ(one.centre, other.centre);
  EXPECT_EQ(one.scale, other.scale);
  EXPECT_EQ(one.low, other.low);
  EXPECT_EQ(one.high, other.high);
  EXPECT_EQ(one.contracted, other.contracted);
  EXPECT_EQ(one.backgroundBlock, other.backgroundBlock);
  EXPECT_EQ(one.macroblocks, other.macroblocks);
}

}  // namespace tessera::tiles_test
