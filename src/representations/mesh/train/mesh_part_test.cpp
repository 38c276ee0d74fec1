#include "representations/mesh/train/mesh_part.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tessera {
namespace {

BlockGrid twoByThree() {
  BlockGrid grid;
  grid.originInWorld = {10, -4, 2};
  grid.gridFromWorld = Eigen::AngleAxisd(0.4, Vec3d::UnitZ()).toRotationMatrix();
  grid.edge = 8;
  grid.columns = 2;
  grid.rows = 3;
  grid.bottom = -1;
  grid.top = 4;
  return grid;
}

TEST(MeshParts, GiveEveryPointOfTheSceneToOnePart) {
  const BlockGrid grid = twoByThree();
  const std::vector<MeshPart> parts = makeMeshParts(grid, true);
  ASSERT_EQ(parts.size(), 7u);
  EXPECT_EQ(parts[3].name, "block_1_1");
  EXPECT_TRUE(parts[6].isBackground());
  for (const MeshPart& part : parts) EXPECT_NEAR(part.halfBlockEdge / part.frame.scale, grid.edge / 2, 1e-5);
  EXPECT_EQ(makeMeshParts(grid, false).size(), 6u);
  std::vector<OctahedraDomain> domains;
  for (const MeshPart& part : parts) {
    domains.push_back(makeOctahedraDomain(part, 16, OctahedraPlacement::checkerboard));
    for (OctahedraGrid& own : domains.back().ownGrids) own.lowest[2] = std::max(own.lowest[2], 0.0f);
    domains.back().grids = domains.back().ownGrids;
  }
  int inBlocks = 0, outside = 0;
  for (double x = -31.3; x < 32; x += 1.7)
    for (double y = -29.1; y < 30; y += 1.9)
      for (double z = -0.9; z < 11; z += 0.7) {
        const Vec3d world = grid.inWorld({x, y, z});
        const bool inside = std::abs(x) < 8 && std::abs(y) < 12 && z < 4;
        int owners = 0;
        for (size_t i = 0; i < parts.size(); ++i) {
          if (!domains[i].latticeCell(parts[i].frame.sceneFromWorld(world))) continue;
          ++owners;
          EXPECT_EQ(parts[i].isBackground(), !inside);
          EXPECT_EQ(parts[i].block, inside ? grid.cellAt({x, y}) : -1);
        }
        EXPECT_EQ(owners, 1) << x << " " << y << " " << z;
        ++(inside ? inBlocks : outside);
      }
  EXPECT_GT(inBlocks, 100);
  EXPECT_GT(outside, 1000);
}

TEST(MeshParts, FindThePlacesOfTheCellsOfTheirLattice) {
  for (const MeshPart& part : makeMeshParts(twoByThree(), true)) {
    const OctahedraDomain domain = makeOctahedraDomain(part, 8, OctahedraPlacement::checkerboard);
    const uint32_t n = domain.latticeCells();
    uint32_t same = 0;
    for (uint32_t cell = 0; cell < n * n * n; ++cell) {
      const Vec3d middle = Vec3d(cell % n, cell / n % n, cell / (n * n)) + Vec3d::Constant(0.5);
      // Where two coordinates are beyond the region's, there are no points.
      const Vec3d fromRegion = (middle * 4 / n - Vec3d::Constant(2)).cwiseAbs();
      if (part.isBackground() && (fromRegion.array() > 1).count() > 1) continue;
      const auto at = domain.latticeCell(domain.fromLattice(middle));
      if (!at) continue;
      EXPECT_EQ(*at, cell) << part.name;
      ++same;
    }
    EXPECT_GT(same, 200u) << part.name;
  }
}

TEST(MeshParts, ShareOneLatticeOutside) {
  MeshPart part = makeMeshParts(twoByThree(), true).back();
  const OctahedraDomain domain = makeOctahedraDomain(part, 16, OctahedraPlacement::checkerboard);
  ASSERT_EQ(domain.grids.size(), 5u);
  EXPECT_EQ(domain.latticeCells(), 32u);
  // Points behind each of the four walls and above.
  for (const Vec3d& towards : {Vec3d{1.3, 0.1, 0.1}, Vec3d{-1.3, 0.1, 0.1}, Vec3d{0.1, 1.5, 0.1}, Vec3d{0.1, -1.5, 0.1},
                               Vec3d{0.1, 0.1, 0.6}}) {
    const auto cell = domain.latticeCell(towards);
    ASSERT_TRUE(cell);
    std::vector<uint32_t> bits(32 * 32 * 32 / 32);
    bits[*cell / 32] |= 1u << *cell % 32;
    int set = 0;
    const std::vector<uint32_t> inGrids = domain.toGrids(bits);
    for (const uint32_t word : inGrids) set += __builtin_popcount(word);
    EXPECT_GE(set, 1);
    // The cell of the grid that contains the point is set.
    bool isSet = false;
    for (size_t g = 0; g < domain.grids.size(); ++g) {
      const OctahedraGrid& grid = domain.grids[g];
      double at[4];
      for (size_t row = 0; row < 4; ++row) {
        const float* const m = grid.gridFromScene.data() + 4 * row;
        at[row] = m[0] * towards.x() + m[1] * towards.y() + m[2] * towards.z() + m[3];
      }
      bool inside = at[3] > 0;
      uint32_t index = 0;
      for (int axis = 2; axis >= 0; --axis) {
        const double place = at[axis] / at[3];
        inside = inside && place >= grid.lowest[axis] && place < grid.highest[axis];
        index = index * grid.resolution + static_cast<uint32_t>(std::max(0.0, place));
      }
      if (inside) isSet = isSet || (inGrids[grid.words() * g + index / 32] >> index % 32 & 1) != 0;
    }
    EXPECT_TRUE(isSet);
  }
}

}  // namespace
}  // namespace tessera
