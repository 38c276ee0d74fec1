#include "representations/mesh/train/level_fit.h"

#include <gtest/gtest.h>

namespace tessera {
namespace {

constexpr uint32_t kCells = 8;

// A grid whose coordinates are those of the scene.
OctahedraGrid makeGrid() {
  OctahedraGrid grid;
  grid.resolution = kCells;
  return grid;
}

// Adds triangles much smaller than a cell.
void addQuad(TriangleList& list, const Vec3d& corner, const Vec3d& along, const Vec3d& across) {
  constexpr int kPieces = 20;
  const Vec3d a = along / kPieces, b = across / kPieces;
  for (int i = 0; i < kPieces; ++i) {
    for (int j = 0; j < kPieces; ++j) {
      const uint32_t first = static_cast<uint32_t>(list.vertices.size());
      const Vec3d at = corner + i * a + j * b;
      for (const Vec3d& vertex : {at, Vec3d(at + a), Vec3d(at + b), Vec3d(at + a + b)}) list.vertices.push_back(vertex);
      list.triangles.push_back({first, first + 1, first + 2});
      list.triangles.push_back({first + 3, first + 2, first + 1});
    }
  }
}

// The vertex of a cell.
Vec3d vertexAt(const std::vector<float>& displacements, uint32_t i, uint32_t j, uint32_t k) {
  const size_t cell = i + size_t{kCells} * (j + size_t{kCells} * k);
  return Vec3d(i, j, k) + Vec3d::Constant(0.5) +
         Vec3d(displacements[3 * cell], displacements[3 * cell + 1], displacements[3 * cell + 2]);
}

const std::vector<float> kBefore(size_t{3} * kCells * kCells * kCells, 0.125f);

TEST(FitVertices, MovesVerticesOntoPlanesEdgesAndCorners) {
  // Three faces of a box that ends at (4.3, 3.6, 2.8).
  const Vec3d corner(4.3, 3.6, 2.8), x(-4, 0, 0), y(0, -3.5, 0), z(0, 0, -2.5);
  TriangleList box;
  addQuad(box, corner, x, y);
  addQuad(box, corner, y, z);
  addQuad(box, corner, x, z);
  const std::vector<float> fitted = fitVertices(box, makeGrid(), kBefore);
  constexpr double kClose = 0.12;  // vertices are drawn to the middle of the surface in their cell
  EXPECT_LT((vertexAt(fitted, 4, 3, 2) - corner).norm(), 2 * kClose) << "the corner";
  EXPECT_LT((vertexAt(fitted, 2, 3, 2) - Vec3d(2.5, 3.6, 2.8)).norm(), kClose) << "an edge";
  EXPECT_LT((vertexAt(fitted, 2, 1, 2) - Vec3d(2.5, 1.5, 2.8)).norm(), 0.02) << "a plane";
  EXPECT_EQ(vertexAt(fitted, 6, 6, 6), vertexAt(kBefore, 6, 6, 6)) << "no triangle crosses this cell";
  for (const float displacement : fitted) EXPECT_LT(std::abs(displacement), kMaxDisplacement);
}

TEST(FitVertices, LeavesVerticesOfCellsThatTrianglesHardlyTouch) {
  TriangleList sliver;
  addQuad(sliver, {2, 2, 2.5}, {0.03, 0, 0}, {0, 1, 0});
  const std::vector<float> fitted = fitVertices(sliver, makeGrid(), kBefore);
  EXPECT_EQ(fitted, kBefore);
  EXPECT_EQ(fitVertices({}, makeGrid(), kBefore), kBefore);
}

TEST(FitVertices, IgnoresTrianglesOutsideTheGridAndWithoutArea) {
  TriangleList list;
  addQuad(list, {-3, -3, -3}, {2, 0, 0}, {0, 2, 0});
  addQuad(list, {9, 9, 9}, {2, 0, 0}, {0, 2, 0});
  addQuad(list, {3, 3, 3.5}, {1, 0, 0}, {2, 0, 0});
  EXPECT_EQ(fitVertices(list, makeGrid(), kBefore), kBefore);
}

TEST(FillPatches, SpreadsKnownTexelsOverTheirPatchAlone) {
  constexpr uint32_t kEdge = 8, kFeatures = MeshField::kFeatures;
  constexpr size_t kTexels = size_t{kEdge} * kEdge;
  std::vector<KnownTexel> known(3 * kTexels, KnownTexel::unseen);
  std::vector<float> texels(3 * kTexels * kFeatures, -9);
  const auto at = [&](size_t patch, uint32_t column, uint32_t row) -> float* {
    return &texels[kFeatures * (patch * kTexels + row * kEdge + column)];
  };
  for (uint32_t f = 0; f < kFeatures; ++f) {
    at(0, 0, 0)[f] = static_cast<float>(f);  // the only known texel of the first patch
    for (uint32_t row = 0; row < kEdge; ++row) {
      at(1, 0, row)[f] = 1;
      at(1, 2, row)[f] = 4;
    }
  }
  known[0] = KnownTexel::seen;
  for (uint32_t row = 0; row < kEdge; ++row)
    known[kTexels + row * kEdge] = known[kTexels + row * kEdge + 2] = KnownTexel::seen;
  known[1] = known[2 * kTexels] = KnownTexel::passed;
  fillPatches(kEdge, known, texels);
  for (uint32_t row = 0; row < kEdge; ++row)
    for (uint32_t column = 0; column < kEdge; ++column)
      for (uint32_t f = 0; f < kFeatures; ++f) {
        EXPECT_FLOAT_EQ(at(0, column, row)[f], column == 1 && row == 0 ? -9 : static_cast<float>(f)) << "or passed";
        EXPECT_FLOAT_EQ(at(1, column, row)[f], column == 0 ? 1 : column == 1 ? 2.5f : 4);
        EXPECT_EQ(at(2, column, row)[f], -9) << "nothing is seen of this patch";
      }
}

}  // namespace
}  // namespace tessera
