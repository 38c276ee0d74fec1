#include "compute/octahedra.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <set>

namespace tessera {
namespace {

constexpr OctahedraPlacement kPlacements[] = {OctahedraPlacement::checkerboard, OctahedraPlacement::all};

using Cell = std::array<int, 3>;

Cell plus(const Cell& a, const Cell& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}

// Calls visit(vertices) for every face of a grid that exists.
template <class Visit>
void forFaces(int n, OctahedraPlacement placement, const Visit& visit) {
  for (int cell = 0; cell < n * n * n; ++cell) {
    const Cell centre = {cell % n, cell / n % n, cell / (n * n)};
    if (!carriesOctahedron(placement, static_cast<uint32_t>(centre[0]), static_cast<uint32_t>(centre[1]),
                           static_cast<uint32_t>(centre[2])))
      continue;
    for (uint32_t local = 0; local < kFacesPerCell; ++local) {
      std::array<Cell, 3> vertices;
      bool exists = true;
      for (int corner = 0; corner < 3; ++corner) {
        vertices[corner] = plus(centre, octahedronFace(local)[corner]);
        for (const int at : vertices[corner]) exists = exists && at >= 0 && at < n;
      }
      if (exists) visit(local, vertices);
    }
  }
}

TEST(Octahedra, HaveEightOuterFacesAndTwelveThatContainTheCentre) {
  std::set<std::set<Cell>> faces;
  for (uint32_t local = 0; local < kFacesPerCell; ++local) {
    const auto corners = octahedronFace(local);
    const std::set<Cell> face(corners.begin(), corners.end());
    EXPECT_EQ(face.size(), 3u);
    EXPECT_TRUE(faces.insert(face).second) << local;
    EXPECT_EQ(face.contains({0, 0, 0}), local >= kOuterFaces) << local;
    std::set<int> axes;
    for (const Cell& corner : corners)
      for (int axis = 0; axis < 3; ++axis)
        if (corner[axis] != 0) axes.insert(axis);
    EXPECT_EQ(axes.size(), local < kOuterFaces ? 3u : 2u) << local;
  }
}

TEST(Octahedra, AreRegularPolyhedraWithoutDisplacement) {
  std::set<Cell> vertices;
  std::set<std::set<Cell>> edges;
  for (uint32_t local = 0; local < kOuterFaces; ++local) {
    const auto corners = octahedronFace(local);
    for (int i = 0; i < 3; ++i) {
      vertices.insert(corners[i]);
      edges.insert({corners[i], corners[(i + 1) % 3]});
      int square = 0;
      for (int axis = 0; axis < 3; ++axis)
        square += (corners[i][axis] - corners[(i + 1) % 3][axis]) * (corners[i][axis] - corners[(i + 1) % 3][axis]);
      EXPECT_EQ(square, 2);  // an edge of √2 cells
    }
  }
  EXPECT_EQ(vertices.size(), 6u);
  EXPECT_EQ(edges.size(), 12u);
  EXPECT_EQ(vertices.size() - edges.size() + kOuterFaces, 2u);  // Euler
}

TEST(Octahedra, FillTheGridWithTheFacesOfThePaper) {
  std::map<OctahedraPlacement, size_t> counts;
  for (const OctahedraPlacement placement : kPlacements)
    forFaces(6, placement, [&](uint32_t, const auto&) { ++counts[placement]; });
  EXPECT_EQ(counts[OctahedraPlacement::checkerboard], 1400u);
  EXPECT_EQ(counts[OctahedraPlacement::all], 2800u);
}

TEST(Octahedra, PutEqualNumbersOfFacesIntoEverySquareAndCubeBetweenCells) {
  for (const OctahedraPlacement placement : kPlacements) {
    std::map<std::pair<Cell, Cell>, int> outer, inner;  // by the box of the cells of the vertices
    std::set<std::set<Cell>> all;
    forFaces(5, placement, [&](uint32_t local, const std::array<Cell, 3>& vertices) {
      Cell low = vertices[0], high = vertices[0];
      for (const Cell& vertex : vertices)
        for (int axis = 0; axis < 3; ++axis) {
          low[axis] = std::min(low[axis], vertex[axis]);
          high[axis] = std::max(high[axis], vertex[axis]);
        }
      ++(local < kOuterFaces ? outer : inner)[{low, high}];
      EXPECT_TRUE(all.insert(std::set<Cell>(vertices.begin(), vertices.end())).second) << "no face exists twice";
    });
    EXPECT_EQ(outer.size(), 4u * 4 * 4);
    EXPECT_EQ(inner.size(), 3u * 4 * 4 * 5);
    const int share = placement == OctahedraPlacement::all ? 2 : 1;
    for (const auto& [box, count] : outer) EXPECT_EQ(count, 4 * share);
    for (const auto& [box, count] : inner) EXPECT_EQ(count, 2 * share);
  }
}

using Point = std::array<double, 3>;

// Six times the volume of a tetrahedron, positive or negative.
double sixfoldVolume(const Point& a, const Point& b, const Point& c, const Point& d) {
  const auto less = [&](const Point& p, int axis) { return p[axis] - a[axis]; };
  double sum = 0;
  for (int x = 0; x < 3; ++x) {
    const int y = (x + 1) % 3, z = (x + 2) % 3;
    sum += less(b, x) * (less(c, y) * less(d, z) - less(c, z) * less(d, y));
  }
  return sum;
}

Point toPoint(const Cell& cell) {
  return {1.0 * cell[0], 1.0 * cell[1], 1.0 * cell[2]};
}

bool isInTetrahedron(const std::array<Point, 4>& corners, const Point& point) {
  const double whole = sixfoldVolume(corners[0], corners[1], corners[2], corners[3]);
  for (int i = 0; i < 4; ++i) {
    std::array<Point, 4> part = corners;
    part[i] = point;
    if (sixfoldVolume(part[0], part[1], part[2], part[3]) / whole < 0) return false;
  }
  return true;
}

// An octahedron consists of the tetrahedra between its centre and its outer faces. With octahedra in every second cell,
// each cube between eight cells has one more tetrahedron: between its four corners that carry no octahedron.
TEST(Octahedra, FillSpaceTogetherWithTetrahedra) {
  constexpr auto kPlacement = OctahedraPlacement::checkerboard;
  const auto carries = [](const Cell& cell) {
    return carriesOctahedron(kPlacement, static_cast<uint32_t>(cell[0]), static_cast<uint32_t>(cell[1]),
                             static_cast<uint32_t>(cell[2]));
  };
  double octahedron = 0;
  for (uint32_t local = 0; local < kOuterFaces; ++local) {
    const auto c = octahedronFace(local);
    octahedron += std::abs(sixfoldVolume({}, toPoint(c[0]), toPoint(c[1]), toPoint(c[2]))) / 6;
  }
  EXPECT_NEAR(octahedron, 4.0 / 3, 1e-12);

  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(2, 4);  // in units of cells, from the vertex of a cell
  for (int i = 0; i < 2000; ++i) {
    const Point point = {place(random), place(random), place(random)};
    int octahedra = 0, tetrahedra = 0;
    forFaces(7, kPlacement, [&](uint32_t local, const std::array<Cell, 3>& vertices) {
      if (local >= kOuterFaces) return;
      Cell centre = vertices[0];  // the corner along x
      centre[0] += (local & 1) != 0 ? 1 : -1;
      octahedra +=
          isInTetrahedron({toPoint(centre), toPoint(vertices[0]), toPoint(vertices[1]), toPoint(vertices[2])}, point);
    });
    for (int cube = 0; cube < 6 * 6 * 6; ++cube) {
      const Cell low = {cube % 6, cube / 6 % 6, cube / 36};
      std::array<Point, 4> corners;
      size_t count = 0;
      for (int corner = 0; corner < 8; ++corner) {
        const Cell cell = plus(low, {corner & 1, corner >> 1 & 1, corner >> 2});
        if (carries(cell)) continue;
        ASSERT_LT(count, 4u);
        corners[count++] = toPoint(cell);
      }
      EXPECT_NEAR(std::abs(sixfoldVolume(corners[0], corners[1], corners[2], corners[3])) / 6, 1.0 / 3, 1e-12);
      tetrahedra += isInTetrahedron(corners, point);
    }
    ASSERT_EQ(octahedra + tetrahedra, 1) << point[0] << " " << point[1] << " " << point[2];
  }
}

TEST(Octahedra, ReachIntoACellWithFaces) {
  for (const uint32_t parity : {0u, 1u}) {
    EXPECT_EQ(reachingFaces(OctahedraPlacement::checkerboard, parity).size(), 56u);
    EXPECT_EQ(reachingFaces(OctahedraPlacement::all, parity).size(), 112u);
  }
  for (const ReachingFace& face : reachingFaces(OctahedraPlacement::checkerboard, 1)) {
    const auto& [x, y, z] = face.octahedron;
    EXPECT_EQ((x + y + z + 1) % 2, 0);
    for (const Cell& corner : octahedronFace(face.local))
      for (const int at : plus(face.octahedron, corner)) EXPECT_LE(std::abs(at), 1) << "beyond the 27 cells";
  }
}

TEST(Octahedra, CoverTheOutsideOfABoxWithoutGaps) {
  constexpr uint32_t kHalfCells = 8;
  const std::array<float, 3> halfEdges = {1, 0.5f, 0.75f};
  for (double x = -3.9; x < 4; x += 0.7)
    for (double y = -3.9; y < 4; y += 0.57)
      for (double z = -2.9; z < 3; z += 0.63) {
        const double scene[3] = {x * 0.9, y * 0.6, z};
        double relative[3], largest = 0, contracted[3];
        for (int axis = 0; axis < 3; ++axis) {
          relative[axis] = scene[axis] / halfEdges[axis];
          largest = std::max(largest, std::abs(relative[axis]));
        }
        for (int axis = 0; axis < 3; ++axis) {
          contracted[axis] = relative[axis] / std::max(1.0, largest);
          if (std::abs(relative[axis]) == largest && largest > 1)
            contracted[axis] = std::copysign(2 - 1 / largest, relative[axis]);
        }
        int owners = 0;
        for (uint32_t side = 0; side < kSides; ++side) {
          const OctahedraGrid grid = makeOutsideGrid(side, kHalfCells, halfEdges, OctahedraPlacement::checkerboard);
          double g[4];
          for (int row = 0; row < 4; ++row) {
            g[row] = grid.gridFromScene[4 * row + 3];
            for (int column = 0; column < 3; ++column)
              g[row] += double{grid.gridFromScene[4 * row + column]} * scene[column];
          }
          bool inside = true;
          for (int axis = 0; axis < 3; ++axis) {
            g[axis] /= g[3];
            inside = inside && g[axis] >= grid.lowest[axis] && g[axis] < grid.highest[axis];
          }
          if (!inside) continue;
          ++owners;
          EXPECT_GT(g[3], 0);
          for (int axis = 0; axis < 3; ++axis)
            EXPECT_NEAR((g[axis] + grid.positionOffset[axis]) * grid.positionScale(), (contracted[axis] + 2) / 4, 1e-5);
        }
        EXPECT_EQ(owners, largest > 1 && largest < kHalfCells / 2 ? 1 : 0) << x << " " << y << " " << z;
      }
}

}  // namespace
}  // namespace tessera
