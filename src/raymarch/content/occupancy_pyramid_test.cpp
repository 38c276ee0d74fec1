#include "raymarch/content/occupancy_pyramid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "base/random.h"

namespace tessera {
namespace {

OccupancyBits scattered(uint32_t cells, uint32_t inverseDensity, uint64_t seed) {
  OccupancyBits bits(cells);
  const RandomStream random(seed, cells);
  for (size_t i = 0; i < bits.count(); ++i) {
    if (random.below(i, inverseDensity) == 0) bits.set(i);
  }
  return bits;
}

// The definition: the minimum over all occupied cells.
std::vector<uint8_t> distancesByDefinition(const OccupancyBits& bits) {
  const int n = static_cast<int>(bits.cells);
  std::vector<std::array<int, 3>> occupied;
  for (int i = 0; i < n * n * n; ++i) {
    if (bits.at(static_cast<size_t>(i))) occupied.push_back({i % n, i / n % n, i / n / n});
  }
  std::vector<uint8_t> distances;
  for (int i = 0; i < n * n * n; ++i) {
    int minimum = kFarthestDistance;
    for (const auto& [x, y, z] : occupied) {
      minimum = std::min(minimum, std::max({std::abs(x - i % n), std::abs(y - i / n % n), std::abs(z - i / n / n)}));
    }
    distances.push_back(static_cast<uint8_t>(minimum));
  }
  return distances;
}

TEST(OccupancyPyramid, DistancesAreTheLeastOverAllOccupiedCells) {
  for (const uint32_t cells : {1u, 2u, 3u, 5u, 8u, 13u}) {
    for (const uint32_t inverseDensity : {1u, 4u, 40u, 400u, 4000u}) {
      const OccupancyBits bits = scattered(cells, inverseDensity, inverseDensity);
      EXPECT_EQ(chebyshevDistances(bits), distancesByDefinition(bits)) << cells << " " << inverseDensity;
    }
  }
}

TEST(OccupancyPyramid, DistancesFromACornerReachTheFarEndAndStopAt255) {
  OccupancyBits bits(300);
  bits.set(bits.number(299, 0, 150));
  const auto distances = chebyshevDistances(bits);
  EXPECT_EQ(distances[bits.number(299, 0, 150)], 0);
  EXPECT_EQ(distances[bits.number(298, 1, 149)], 1);
  EXPECT_EQ(distances[bits.number(299, 200, 150)], 200);
  EXPECT_EQ(distances[bits.number(299, 254, 150)], 254);
  EXPECT_EQ(distances[bits.number(44, 0, 0)], 255);
  EXPECT_EQ(distances[bits.number(43, 0, 0)], 255);
  EXPECT_EQ(distances[bits.number(0, 299, 299)], 255);
}

TEST(OccupancyPyramid, HasTheMaximumDistanceEverywhereIfNothingIsOccupied) {
  const auto distances = chebyshevDistances(OccupancyBits(6));
  EXPECT_EQ(std::count(distances.begin(), distances.end(), kFarthestDistance), 216);
}

TEST(OccupancyPyramid, OccupancyComesBackFromDistances) {
  const OccupancyBits bits = scattered(11, 5, 3);
  EXPECT_EQ(occupancyFromDistances(chebyshevDistances(bits), 11), bits);
}

TEST(OccupancyPyramid, ACellIsOccupiedWhenOneBelowItIs) {
  for (const uint32_t cells : {1u, 2u, 7u, 12u}) {
    const OccupancyBits bits = scattered(cells, 30, cells);
    const OccupancyPyramid pyramid = pyramidFromDistances(chebyshevDistances(bits), cells);
    EXPECT_EQ(pyramid.levels.front(), bits);
    EXPECT_EQ(pyramid.levels.back().cells, 1u);
    for (size_t level = 0; level < pyramid.levels.size(); ++level) {
      const OccupancyBits& above = pyramid.levels[level];
      EXPECT_EQ(above.cells, (cells + (1u << level) - 1) >> level);
      OccupancyBits expected(above.cells);
      for (uint32_t z = 0; z < cells; ++z) {
        for (uint32_t y = 0; y < cells; ++y) {
          for (uint32_t x = 0; x < cells; ++x) {
            if (bits.at(x, y, z)) expected.set(expected.number(x >> level, y >> level, z >> level));
          }
        }
      }
      EXPECT_EQ(above, expected) << cells << " level " << level;
    }
  }
}

}  // namespace
}  // namespace tessera
