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

// Is the cube of k cells an edge empty that begins at the cell and lies in the octant?
bool isEmptyCube(const OccupancyBits& bits, const Cell& cell, uint32_t octant, int k) {
  const auto within = [&](int c) { return c >= 0 && c < static_cast<int>(bits.cells); };
  for (int i = 0; i < k * k * k; ++i) {
    const int offset[3] = {i % k, i / k % k, i / k / k};
    int at[3];
    for (int a = 0; a < 3; ++a) at[a] = cell.at[a] + (octant >> a & 1 ? offset[a] : -offset[a]);
    if (within(at[0]) && within(at[1]) && within(at[2]) &&
        bits.at(static_cast<uint32_t>(at[0]), static_cast<uint32_t>(at[1]), static_cast<uint32_t>(at[2]))) {
      return false;
    }
  }
  return true;
}

// Invariant 7.
TEST(OccupancyDistance, IsTheLargestEmptyCubeOfEachOctant) {
  for (const uint32_t cells : {1u, 2u, 5u, 8u, 20u}) {
    for (const uint32_t oneOf : {1u, 4u, 40u, 400u, 4000u}) {
      const OccupancyBits bits = scattered(cells, oneOf, oneOf);
      const std::vector<uint32_t> distances = octantDistances(bits);
      for (size_t i = 0; i<bits.count(); i += cells> 8 ? 7 : 1) {
        for (uint32_t octant = 0; octant < 8; ++octant) {
          const int k = static_cast<int>(octantDistance(distances[i], octant));
          ASSERT_TRUE(isEmptyCube(bits, Cell(i, cells), octant, k)) << cells << " " << oneOf;
          if (k == 15) continue;
          ASSERT_FALSE(isEmptyCube(bits, Cell(i, cells), octant, k + 1)) << cells << " " << oneOf;
        }
      }
    }
  }
}

struct Ray {
  double place[3], direction[3];  // in cells; of length 1
  size_t cell = 0;
  uint32_t octant = 0;

  Ray(const RandomStream& random, uint64_t number, uint32_t cells) {
    double square = 0;
    for (int a = 2; a >= 0; --a) {
      place[a] = cells * random.uniformDouble(6 * number + static_cast<uint64_t>(a));
      direction[a] = 2 * random.uniformDouble(6 * number + 3 + static_cast<uint64_t>(a)) - 1;
      square += direction[a] * direction[a];
      cell = cell * cells + static_cast<size_t>(place[a]);
      octant |= (direction[a] > 0 ? 1u : 0u) << a;
    }
    for (double& d : direction) d /= std::sqrt(square);
  }
  // Out of a cube of k cells that begins at its cell.
  double exit(uint32_t k) const {
    double least = 1e30;
    for (int a = 0; a < 3; ++a) {
      const double face = std::floor(place[a]) + (direction[a] > 0 ? k : 1.0 - k);
      least = std::min(least, (face - place[a]) / direction[a]);
    }
    return least;
  }
};

// Invariant 7: from random places of a cell, in random directions, as far as it says.
TEST(OccupancyDistance, NeverLeadsIntoAnOccupiedCell) {
  const uint32_t cells = 24;
  const OccupancyBits bits = scattered(cells, 900, 9);
  const std::vector<uint32_t> distances = octantDistances(bits);
  const RandomStream random(3, 3);
  int far = 0;
  for (uint64_t number = 0; number < 20000; ++number) {
    const Ray ray(random, number, cells);
    const uint32_t k = octantDistance(distances[ray.cell], ray.octant);
    if (k == 0) continue;
    far += k > 4;
    for (int i = 0; i <= 50; ++i) {
      const double length = ray.exit(k) * (i / 50.0) * (1 - 1e-9);
      size_t reached = 0;
      bool inside = true;
      for (int a = 2; a >= 0; --a) {
        const double x = ray.place[a] + length * ray.direction[a];
        inside = inside && x >= 0 && x < cells;
        reached = reached * cells + static_cast<size_t>(std::max(0.0, x));
      }
      if (!inside) continue;
      ASSERT_FALSE(bits.at(reached)) << number;
    }
  }
  EXPECT_GT(far, 1000) << "rays that have somewhere to go";
}

// The least distance between any places of two cells, or between their middles, to the nearest occupied one, rounded
// down: the paper's grid.
int paperDistance(const OccupancyBits& bits, const Cell& cell, bool middles) {
  double least = 1e9;
  for (size_t i = 0; i < bits.count(); ++i) {
    if (!bits.at(i)) continue;
    const Cell other(i, bits.cells);
    double sum = 0;
    for (int a = 0; a < 3; ++a) {
      const int apart = std::abs(cell.at[a] - other.at[a]), free = middles ? apart : std::max(apart - 1, 0);
      sum += free * free;
    }
    least = std::min(least, std::sqrt(sum));
  }
  return static_cast<int>(least);
}

// Why the paper's grid is not what we use.
TEST(OccupancyDistance, ReachesFurtherThanTheBallOfThePaper) {
  const uint32_t cells = 15;
  const OccupancyBits bits = scattered(cells, 300, 11);
  const std::vector<uint32_t> distances = octantDistances(bits);
  const RandomStream random(5, 5);
  double cubes = 0, balls = 0;
  for (uint64_t number = 0; number < 3000; ++number) {
    const Ray ray(random, number, cells);
    const uint32_t k = octantDistance(distances[ray.cell], ray.octant);
    if (k == 0) continue;
    const int ball = paperDistance(bits, Cell(ray.cell, cells), false);
    // Within the ball nothing is, so a cube of that many cells along its diagonal lies in what is empty.
    EXPECT_GE(k, static_cast<uint32_t>(ball / std::sqrt(3.0)));
    cubes += ray.exit(k);
    balls += std::max<double>(ball, ray.exit(1));
  }
  EXPECT_GT(cubes, 1.3 * balls);
}

// Invariant 8.
TEST(OccupancyDistance, BetweenMiddlesWouldLeadIntoTheCellAcrossACorner) {
  OccupancyBits bits(4);
  bits.set(bits.number(1, 1, 1));
  const size_t across = bits.number(2, 2, 2);
  EXPECT_EQ(paperDistance(bits, Cell(across, 4), true), 1);  // though the two touch
  EXPECT_EQ(paperDistance(bits, Cell(across, 4), false), 0);
  EXPECT_EQ(octantDistance(octantDistances(bits)[across], 0), 1u);  // towards it: out of its own cell
  EXPECT_GT(octantDistance(octantDistances(bits)[across], 7), 1u);  // away from it
}

TEST(OccupancyDistance, StopsAt15) {
  OccupancyBits bits(40);
  bits.set(bits.number(39, 39, 39));
  const std::vector<uint32_t> distances = octantDistances(bits);
  EXPECT_EQ(octantDistance(distances[bits.number(0, 0, 0)], 7), 15u);
  EXPECT_EQ(octantDistance(distances[bits.number(30, 39, 39)], 7), 9u);
  EXPECT_EQ(octantDistance(distances[bits.number(30, 39, 39)], 6), 15u);
  EXPECT_EQ(distances[bits.number(39, 39, 39)], 0u);
  const std::vector<uint32_t> nowhere = octantDistances(OccupancyBits(6));
  EXPECT_EQ(std::count(nowhere.begin(), nowhere.end(), 0xffffffffu), 216);
}

}  // namespace
}  // namespace tessera
