#include "tiles/occupancy_distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "base/random.h"

namespace tessera {
namespace {

OccupancyBits scattered(uint32_t cells, uint32_t oneOf, uint64_t seed) {
  OccupancyBits bits(cells);
  const RandomStream random(seed, cells);
  for (size_t i = 0; i < bits.count(); ++i) {
    if (random.below(i, oneOf) == 0) bits.set(i);
  }
  return bits;
}

struct Cell {
  int at[3];

  Cell(size_t number, uint32_t cells)
      : at{static_cast<int>(number % cells), static_cast<int>(number / cells % cells),
           static_cast<int>(number / cells / cells)} {}
};

// Between the nearest places of two cells, or their middles; squared.
int squareBetween(const Cell& one, const Cell& other, bool middles) {
  int sum = 0;
  for (int a = 0; a < 3; ++a) {
    const int apart = std::abs(one.at[a] - other.at[a]), free = middles ? apart : std::max(apart - 1, 0);
    sum += free * free;
  }
  return sum;
}

std::vector<uint8_t> byDefinition(const OccupancyBits& bits, bool middles) {
  std::vector<Cell> occupied;
  for (size_t i = 0; i < bits.count(); ++i) {
    if (bits.at(i)) occupied.emplace_back(i, bits.cells);
  }
  std::vector<uint8_t> distances;
  for (size_t i = 0; i < bits.count(); ++i) {
    double least = kFarthestDistance;
    for (const Cell& cell : occupied) {
      least = std::min(least, std::sqrt(squareBetween(Cell(i, bits.cells), cell, middles)));
    }
    distances.push_back(static_cast<uint8_t>(least));
  }
  return distances;
}

TEST(OccupancyDistance, IsTheLeastBetweenAnyPlacesOfTwoCellsRoundedDown) {
  for (const uint32_t cells : {1u, 2u, 5u, 8u, 13u}) {
    for (const uint32_t oneOf : {1u, 4u, 40u, 400u, 4000u}) {
      const OccupancyBits bits = scattered(cells, oneOf, oneOf);
      EXPECT_EQ(occupancyDistances(bits), byDefinition(bits, false)) << cells << " " << oneOf;
      EXPECT_EQ(naiveOccupancyDistances(bits), byDefinition(bits, true)) << cells << " " << oneOf;
    }
  }
}

// Invariant 7.
TEST(OccupancyDistance, IsNothingInOccupiedCellsAndBesideThem) {
  const OccupancyBits bits = scattered(16, 200, 5);
  const std::vector<uint8_t> distances = occupancyDistances(bits);
  for (size_t i = 0; i < distances.size(); ++i) {
    const Cell cell(i, bits.cells);
    bool beside = false;
    for (int k = 0; k < 27; ++k) {
      const int x = cell.at[0] + k % 3 - 1, y = cell.at[1] + k / 3 % 3 - 1, z = cell.at[2] + k / 9 - 1;
      const auto within = [](int c) { return c >= 0 && c < 16; };
      beside = beside || (within(x) && within(y) && within(z) &&
                          bits.at(static_cast<uint32_t>(x), static_cast<uint32_t>(y), static_cast<uint32_t>(z)));
    }
    EXPECT_EQ(distances[i] == 0, beside);
  }
}

// Invariant 7: from random places of a cell, in random directions, as far as it says.
TEST(OccupancyDistance, NeverLeadsIntoAnOccupiedCell) {
  const uint32_t cells = 24;
  const OccupancyBits bits = scattered(cells, 900, 9);
  const std::vector<uint8_t> distances = occupancyDistances(bits);
  const RandomStream random(3, 3);
  int far = 0;
  for (uint64_t ray = 0; ray < 20000; ++ray) {
    double place[3], direction[3], square = 0;
    size_t cell = 0;
    for (int a = 2; a >= 0; --a) {
      place[a] = cells * random.uniformDouble(6 * ray + static_cast<uint64_t>(a));
      direction[a] = 2 * random.uniformDouble(6 * ray + 3 + static_cast<uint64_t>(a)) - 1;
      square += direction[a] * direction[a];
      cell = cell * cells + static_cast<size_t>(place[a]);
    }
    far += distances[cell] > 2;
    for (int i = 0; i <= 50; ++i) {
      const double length = distances[cell] * (i / 50.0) * (1 - 1e-9);
      size_t reached = 0;
      bool inside = true;
      for (int a = 2; a >= 0; --a) {
        const double x = place[a] + length * direction[a] / std::sqrt(square);
        inside = inside && x >= 0 && x < cells;
        reached = reached * cells + static_cast<size_t>(std::max(0.0, x));
      }
      if (inside && distances[cell] > 0) {
        ASSERT_FALSE(bits.at(reached)) << ray;
      }
    }
  }
  EXPECT_GT(far, 1000) << "rays that have somewhere to go";
}

// Invariant 8: why the paper's is not what we use.
TEST(OccupancyDistance, BetweenMiddlesLeadsIntoTheCellAcrossACorner) {
  OccupancyBits bits(4);
  bits.set(bits.number(1, 1, 1));
  const size_t across = bits.number(2, 2, 2);
  EXPECT_EQ(naiveOccupancyDistances(bits)[across], 1);  // though the two touch
  EXPECT_EQ(occupancyDistances(bits)[across], 0);
}

TEST(OccupancyDistance, StopsAt255) {
  OccupancyBits bits(300);
  bits.set(bits.number(299, 299, 299));
  const std::vector<uint8_t> distances = occupancyDistances(bits);
  EXPECT_EQ(distances[bits.number(0, 0, 0)], 255);
  EXPECT_EQ(distances[bits.number(299, 299, 45)], 253);
  EXPECT_EQ(distances[bits.number(299, 299, 43)], 255);
  const std::vector<uint8_t> nowhere = occupancyDistances(OccupancyBits(6));
  EXPECT_EQ(std::count(nowhere.begin(), nowhere.end(), kFarthestDistance), 216);
}

}  // namespace
}  // namespace tessera
