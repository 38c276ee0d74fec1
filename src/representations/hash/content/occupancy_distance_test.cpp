#include "representations/hash/content/occupancy_distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
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

struct Cell {
  int at[3];

  Cell(size_t number, uint32_t cells)
      : at{static_cast<int>(number % cells), static_cast<int>(number / cells % cells),
           static_cast<int>(number / cells / cells)} {}
};

// Returns whether the cube of k³ cells that begins at the cell and extends into the octant is empty.
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

// Invariant 7 of `hash` (docs/invariants.md).
TEST(OccupancyDistance, IsTheLargestEmptyCubeOfEachOctant) {
  for (const uint32_t cells : {1u, 2u, 5u, 8u, 20u}) {
    for (const uint32_t inverseDensity : {1u, 4u, 40u, 400u, 4000u}) {
      const OccupancyBits bits = scattered(cells, inverseDensity, inverseDensity);
      const std::vector<uint32_t> distances = octantDistances(bits);
      for (size_t i = 0; i<bits.count(); i += cells> 8 ? 7 : 1) {
        for (uint32_t octant = 0; octant < 8; ++octant) {
          const int k = static_cast<int>(octantDistance(distances[i], octant));
          ASSERT_TRUE(isEmptyCube(bits, Cell(i, cells), octant, k)) << cells << " " << inverseDensity;
          if (k == 15) continue;
          ASSERT_FALSE(isEmptyCube(bits, Cell(i, cells), octant, k + 1)) << cells << " " << inverseDensity;
        }
      }
    }
  }
}

// Returns the distance of a finest cell from whichever grid stores it, and in `edge` the width of that grid's cells in
// finest cells.
uint32_t lookUpDistance(const OctantDistanceField& distances, const Cell& cell, uint32_t octant, uint32_t& edge) {
  const size_t n = distances.cells, r = distances.ratio;
  size_t coarse = 0, fine = 0;
  for (int a = 2; a >= 0; --a) {
    coarse = coarse * n + static_cast<size_t>(cell.at[a]) / r;
    fine = fine * r + static_cast<size_t>(cell.at[a]) % r;
  }
  const uint32_t word = distances.coarse[coarse];
  edge = OctantDistanceField::isEmpty(word) ? distances.ratio : 1;
  if (edge > 1 || r == 1) return OctantDistanceField::isEmpty(word) ? octantDistance(word, octant) : 0;
  return octantDistance(distances.fine[(word >> 4) * r * r * r + fine], octant);
}

// Invariant 7 of `hash` (docs/invariants.md), where distances are stored in two grids.
TEST(OccupancyDistance, IsThatOfNearlyTheLargestEmptyCubesInTwoGrids) {
  for (const uint32_t cells : {128u, 136u, 264u}) {
    OccupancyBits bits(cells);
    const RandomStream random(5, cells);
    for (uint64_t ball = 0; ball < 30; ++ball) {  // clusters, and some single cells
      const uint32_t size = static_cast<uint32_t>(1 + ball % 7);
      uint32_t at[3];
      for (uint64_t a = 0; a < 3; ++a) at[a] = random.below(4 * ball + a, cells - size);
      for (uint32_t i = 0; i < size * size * size; ++i) {
        bits.set(bits.number(at[0] + i % size, at[1] + i / size % size, at[2] + i / size / size));
      }
    }
    std::vector<size_t> set;
    for (size_t i = 0; i < bits.count(); ++i) {
      if (bits.at(i)) set.push_back(i);
    }
    const OccupancyPyramid pyramid = pyramidFromOccupancy(bits);
    const OctantDistanceField distances = octantDistances(pyramid);
    EXPECT_EQ(distances.ratio, cells <= 128 ? 1u : cells <= 256 ? 2u : 4u);
    EXPECT_EQ(distances.nearCells(), countNearCells(pyramid));
    size_t occupied = 0, near = 0;
    double stored = 0, largest = 0;
    for (uint64_t number = 0; number < 4000; ++number) {
      // Most cells are next to occupied ones.
      size_t i = random.below(1000 + number, static_cast<uint32_t>(bits.count()));
      if (number % 20 != 0) i = set[i % set.size()] - std::min<size_t>(set[i % set.size()], number % 3);
      const uint32_t octant = static_cast<uint32_t>(number % 8);
      uint32_t edge = 0;
      const uint32_t k = lookUpDistance(distances, Cell(i, cells), octant, edge);
      occupied += bits.at(i);
      ASSERT_EQ(k == 0, bits.at(i));
      if (k == 0 || (edge > 1 && number % 100 != 0)) continue;
      // A coarse cell's cube begins at its own corner.
      Cell from(i, cells);
      for (int a = 0; a < 3; ++a) {
        const int e = static_cast<int>(edge), lower = from.at[a] / e * e;
        from.at[a] = octant >> a & 1 ? lower : lower + e - 1;
      }
      ASSERT_TRUE(isEmptyCube(bits, from, octant, static_cast<int>(k * edge)));
      if (edge > 1 || cells <= 128) continue;
      ++near;
      int trueEdge = static_cast<int>(k);
      while (trueEdge < 15 && isEmptyCube(bits, from, octant, trueEdge + 1)) ++trueEdge;
      stored += k;
      largest += trueEdge;
    }
    EXPECT_GT(occupied, 300u);
    if (cells > 128) {
      EXPECT_GT(near, 200u) << cells;
    }
    EXPECT_GE(stored, 0.6 * largest) << cells;
  }
}

struct Ray {
  double place[3], direction[3];  // the place in cells; the direction has length 1
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
  // Returns the distance at which the ray leaves the cube of k³ cells that begins at its cell.
  double exit(uint32_t k) const {
    double minimum = 1e30;
    for (int a = 0; a < 3; ++a) {
      const double face = std::floor(place[a]) + (direction[a] > 0 ? k : 1.0 - k);
      minimum = std::min(minimum, (face - place[a]) / direction[a]);
    }
    return minimum;
  }
};

// Invariant 7 of `hash` (docs/invariants.md): no ray from a random place in a random direction meets an occupied cell
// within the distance.
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
  EXPECT_GT(far, 1000) << "rays with a large distance";
}

// Returns the distance from a cell to the nearest occupied one, rounded down: the paper's grid. It is measured between
// the closest points of the two cells, or between their centres.
int paperDistance(const OccupancyBits& bits, const Cell& cell, bool centres) {
  double minimum = 1e9;
  for (size_t i = 0; i < bits.count(); ++i) {
    if (!bits.at(i)) continue;
    const Cell other(i, bits.cells);
    double sum = 0;
    for (int a = 0; a < 3; ++a) {
      const int apart = std::abs(cell.at[a] - other.at[a]), free = centres ? apart : std::max(apart - 1, 0);
      sum += free * free;
    }
    minimum = std::min(minimum, std::sqrt(sum));
  }
  return static_cast<int>(minimum);
}

// This is why the paper's grid is not used.
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
    // The ball is empty, and so is the cube whose diagonal is as long as the ball's radius.
    EXPECT_GE(k, static_cast<uint32_t>(ball / std::sqrt(3.0)));
    cubes += ray.exit(k);
    balls += std::max<double>(ball, ray.exit(1));
  }
  EXPECT_GT(cubes, 1.3 * balls);
}

// Invariant 8 of `hash` (docs/invariants.md).
TEST(OccupancyDistance, StaysSafeAcrossACornerWhereDistancesBetweenCentresDoNot) {
  OccupancyBits bits(4);
  bits.set(bits.number(1, 1, 1));
  const size_t across = bits.number(2, 2, 2);
  EXPECT_EQ(paperDistance(bits, Cell(across, 4), true), 1);  // although the two cells touch
  EXPECT_EQ(paperDistance(bits, Cell(across, 4), false), 0);
  EXPECT_EQ(octantDistance(octantDistances(bits)[across], 0),
            1u);  // towards the occupied cell: only to the end of its own cell
  EXPECT_GT(octantDistance(octantDistances(bits)[across], 7), 1u);  // away from the occupied cell
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
