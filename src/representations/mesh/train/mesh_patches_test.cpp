#include "representations/mesh/train/mesh_patches.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "base/random.h"
#include "representations/mesh/content/patch_texels.h"
#include "representations/mesh/train/face_set.h"
#include "representations/mesh/train/mesh_part.h"

namespace tessera {
namespace {

TEST(FaceSet, DropsTheFacesThatContributeLeast) {
  const OctahedraGrid grid{8};
  const auto remaining = [&](double share) {
    FaceSet faces({&grid, 1});
    for (const auto& [face, contribution] : {std::pair{7u, 2.0f}, {5u, 0.0f}, {40u, 3.5f}, {9u, 1.0f}, {11u, 3.5f}})
      faces.add(face, Vec3f::UnitX(), contribution);
    faces.dropLeast(share);
    return faces.numbers();
  };
  EXPECT_EQ(remaining(0), (std::vector<uint32_t>{5, 7, 9, 11, 40}));
  EXPECT_EQ(remaining(0.05), (std::vector<uint32_t>{7, 9, 11, 40}));
  EXPECT_EQ(remaining(0.29), (std::vector<uint32_t>{7, 11, 40}));
  EXPECT_EQ(remaining(0.31), (std::vector<uint32_t>{11, 40}));
  EXPECT_EQ(remaining(0.66), (std::vector<uint32_t>{40})) << "of equal ones the first";
}

// A strip of triangles (0, 1, 2), (1, 2, 3), (2, 3, 4), …, folded by 90° between the second and the third.
TriangleList foldedStrip() {
  TriangleList list;
  list.vertices = {{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}, {1, 0, 1}, {1, 1, 1}};
  for (uint32_t i = 0; i < 4; ++i) list.triangles.push_back({i, i + 1, i + 2});
  list.gridOfTriangle.assign(4, 0);
  return list;
}

TEST(MeshPatches, PairTheFlattestTrianglesThatShareAnEdge) {
  const std::vector<TrianglePatch> patches = pairTriangles(foldedStrip());
  ASSERT_EQ(patches.size(), 2u);
  std::set<std::set<uint32_t>> corners;
  for (const TrianglePatch& patch : patches) {
    EXPECT_TRUE(patch.isPair);
    corners.insert({patch.corners.begin(), patch.corners.end()});
    EXPECT_NE(patch.corners[0], patch.corners[3]);
  }
  EXPECT_EQ(corners, (std::set<std::set<uint32_t>>{{0, 1, 2, 3}, {2, 3, 4, 5}})) << "not across the fold";
}

TEST(MeshPatches, HoldEveryTriangleOnce) {
  TriangleList list = foldedStrip();
  list.triangles.push_back({0, 1, 4});  // one too many for pairs
  list.gridOfTriangle.push_back(0);
  const std::vector<TrianglePatch> patches = pairTriangles(list);
  std::multiset<std::set<uint32_t>> expected, inPatches;
  for (const auto& t : list.triangles) expected.insert({t[0], t[1], t[2]});
  bool hasSingle = false;
  for (const TrianglePatch& patch : patches) {
    EXPECT_FALSE(hasSingle && patch.isPair) << "pairs come first";
    hasSingle = hasSingle || !patch.isPair;
    const auto& c = patch.corners;
    inPatches.insert({c[0], c[1], c[2]});
    if (patch.isPair) inPatches.insert({c[3], c[2], c[1]});
  }
  EXPECT_EQ(inPatches, expected);
  EXPECT_TRUE(hasSingle);
}

TEST(MeshPatches, HaveTexelsOnTheirTriangles) {
  const std::array<Vec3d, 4> corners = {Vec3d{0, 0, 0}, Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{1, 1, 0.5}};
  constexpr uint32_t kEdge = 5;
  EXPECT_EQ(texelPosition(corners, true, 0, 0, kEdge), corners[0]);
  EXPECT_EQ(texelPosition(corners, true, 4, 0, kEdge), corners[1]);
  EXPECT_EQ(texelPosition(corners, true, 0, 4, kEdge), corners[2]);
  EXPECT_EQ(texelPosition(corners, true, 4, 4, kEdge), corners[3]);
  EXPECT_EQ(texelPosition(corners, true, 2, 2, kEdge), Vec3d(0.5, 0.5, 0)) << "on the common edge";
  EXPECT_EQ(texelPosition(corners, true, 4, 2, kEdge), Vec3d(1, 0.5, 0.25));
  EXPECT_EQ(texelPosition(corners, false, 4, 4, kEdge), Vec3d(1, 1, 0)) << "the first triangle's plane goes on";
}

TEST(MeshPatches, AreOfEveryGridThatTheyReachInto) {
  OctahedraGrid grid{8, OctahedraPlacement::all};
  grid.gridFromScene = {4, 0, 0, 4, 0, 4, 0, 4, 0, 0, 4, 4, 0, 0, 0, 1};
  OctahedraGrid left = grid, right = grid;
  left.highest[0] = right.lowest[0] = 3.7f;
  const std::vector<float> displacements(size_t{3} * grid.cells(), 0.1f);
  std::vector<uint32_t> bits(faceWords({&grid, 1}));
  size_t faces = 0, across = 0;  // faces that cross the wall between both
  for (uint32_t cell = 0; cell < grid.cells(); ++cell) {
    const uint32_t place[3] = {cell % 8, cell / 8 % 8, cell / 64};
    if (std::min({place[0], place[1], place[2]}) == 0 || std::max({place[0], place[1], place[2]}) == 7) continue;
    for (uint32_t local = 0; local < kFacesPerCell; ++local, ++faces) {
      bits[(cell * kFacesPerCell + local) / 32] |= 1u << (cell * kFacesPerCell + local) % 32;
      const auto corners = octahedronFace(local);
      const auto [low, high] = std::minmax({corners[0][0], corners[1][0], corners[2][0]});
      across += static_cast<int>(place[0]) + low <= 3 && static_cast<int>(place[0]) + high >= 4;
    }
  }
  const auto count = [&](const OctahedraGrid& owner) {
    return listTriangles({&grid, 1}, {&owner, 1}, displacements, bits).triangles.size();
  };
  EXPECT_EQ(count(grid), faces);
  EXPECT_GT(count(left), faces / 4);
  EXPECT_GT(across, 0u);
  EXPECT_EQ(count(left) + count(right), faces + across);
  OctahedraGrid beside = grid;
  beside.lowest[0] = 7.61f;
  EXPECT_EQ(count(beside), 0u) << "no vertex is there";
  const TriangleList all = listTriangles({&grid, 1}, {&grid, 1}, displacements, bits);
  EXPECT_EQ(all.vertices.size(), 8u * 8 * 8 - 8 - 12 * 6) << "shared by all triangles; corners and edges have none";
  for (const Vec3d& vertex : all.vertices) EXPECT_LT(vertex.cwiseAbs().maxCoeff(), 1);
}

// Returns whether a point is in a triangle, seen from above.
bool covers(const std::array<Vec3d, 3>& triangle, const Vec2d& point) {
  std::array<bool, 3> isLeft{};
  for (size_t i = 0; i < 3; ++i) {
    const Vec2d from = triangle[i].head<2>(), along = triangle[(i + 1) % 3].head<2>() - from, to = point - from;
    isLeft[i] = along.x() * to.y() - along.y() * to.x() >= 0;
  }
  return isLeft[0] == isLeft[1] && isLeft[1] == isLeft[2];
}

// The ground of two blocks: the inner faces of one layer of octahedra, whose vertices each block has moved on its own.
TEST(MeshPatches, LeaveNoGapAtTheWallBetweenBlocks) {
  constexpr uint32_t kCells = 16, kLayer = 8, kFirst = kOuterFaces, kLast = kOuterFaces + 3;  // in x and y
  std::vector<std::array<Vec3d, 3>> triangles;                                                // in the world
  for (const double side : {-1.0, 1.0}) {
    MeshPart block{"block", 0, {}, {1, 1, 1}};
    block.frame.centre = {side, 0, 0};
    const OctahedraDomain domain = makeOctahedraDomain(block, kCells, OctahedraPlacement::checkerboard);
    const RandomStream random(7, side > 0 ? 1 : 0);
    std::vector<float> displacements(size_t{3} * kCells * kCells * kCells);
    for (size_t i = 0; i < displacements.size(); ++i) displacements[i] = 0.6f * (random.uniform(i) - 0.5f);
    FaceSet faces(domain.grids);
    for (uint32_t cell = kLayer * kCells * kCells; cell < (kLayer + 1) * kCells * kCells; ++cell)
      for (uint32_t local = kFirst; local <= kLast; ++local) faces.add(cell * kFacesPerCell + local);
    const TriangleList list = listTriangles(domain.grids, domain.ownGrids, displacements, faces.bits());
    for (const auto& [a, b, c] : list.triangles) {
      const auto inWorld = [&](uint32_t vertex) { return block.frame.worldFromScene(list.vertices[vertex]); };
      triangles.push_back({inWorld(a), inWorld(b), inWorld(c)});
    }
  }
  const RandomStream random(8);
  for (uint64_t i = 0; i < 4000; ++i) {
    const Vec2d point(0.4 * (random.uniformDouble(2 * i) - 0.5), 1.8 * (random.uniformDouble(2 * i + 1) - 0.5));
    EXPECT_TRUE(std::any_of(triangles.begin(), triangles.end(), [&](const auto& each) { return covers(each, point); }))
        << point.transpose();
  }
}

}  // namespace
}  // namespace tessera
