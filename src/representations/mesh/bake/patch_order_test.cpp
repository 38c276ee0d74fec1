#include "representations/mesh/bake/patch_order.h"

#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "base/random.h"

namespace tessera {
namespace {

constexpr uint32_t kColumns = 24, kRows = 16, kEdge = 8;

// Adds a patch whose texels are all of one value, seen along `direction`.
void addPatch(const std::array<Vec3d, 4>& corners, const Vec3d& direction, uint8_t value, BakedPatches& to) {
  for (const Vec3d& corner : corners) to.vertices.insert(to.vertices.end(), corner.begin(), corner.end());
  for (int axis = 0; axis < 3; ++axis) to.directions.push_back(static_cast<float>(direction[axis]));
  to.texels.insert(to.texels.end(), size_t{kEdge} * kEdge * BakedPatches::kNumbers, value);
}

// A plane, seen from above: columns × rows squares, of which the last rows are single triangles.
BakedPatches makeGrid(uint32_t rowsOfPairs) {
  BakedPatches grid;
  grid.patchEdge = kEdge;
  for (uint32_t row = 0; row < kRows; ++row)
    for (uint32_t column = 0; column < kColumns; ++column) {
      const Vec3d at(column, row, 0), x = Vec3d::UnitX(), y = Vec3d::UnitY();
      addPatch({at, at + x, at + y, at + x + y}, -Vec3d::UnitZ(), static_cast<uint8_t>(column + row), grid);
    }
  grid.pairs = rowsOfPairs * kColumns;
  return grid;
}

// The numbers of all patches, the pairs and the others in random order.
std::vector<uint32_t> shuffle(const BakedPatches& patches) {
  std::vector<uint32_t> numbers(patches.patches());
  std::iota(numbers.begin(), numbers.end(), 0);
  const RandomStream random(1, 0);
  std::sort(numbers.begin(), numbers.end(), [&](uint32_t a, uint32_t b) {
    const bool isPair = a < patches.pairs, isOtherPair = b < patches.pairs;
    return isPair != isOtherPair ? isPair : random.bits(a) < random.bits(b);
  });
  return numbers;
}

double missesPerTriangle(const BakedPatches& patches, const std::vector<uint32_t>& numbers) {
  constexpr uint32_t kCacheSize = 16;
  const IndexedTriangles triangles = indexTriangles(patches, numbers);
  return double{meshopt_analyzeVertexCache(triangles.indices.data(), triangles.indices.size(), triangles.vertexCount(),
                                           kCacheSize, 0, 0)
                    .acmr};
}

// Corners and texels of the patches of a set, the pairs first.
using PatchContents = std::pair<bool, std::vector<double>>;
std::multiset<PatchContents> listPatches(const PatchSet& set) {
  std::multiset<PatchContents> all;
  for (uint32_t patch = 0; patch < set.patches; ++patch) {
    std::vector<double> numbers;
    for (uint32_t corner = 0; corner < 4; ++corner) {
      const Vec3d x = set.corner(patch, corner);
      numbers.insert(numbers.end(), x.begin(), x.end());
    }
    for (uint32_t texel = 0; texel < kEdge * kEdge; ++texel) {
      const MeshTexel mixed =
          mixTexels(set, patch, static_cast<float>(texel % kEdge), static_cast<float>(texel / kEdge));
      numbers.insert(numbers.end(), mixed.features.begin(), mixed.features.end());
      numbers.push_back(double{mixed.opacity});
    }
    all.emplace(patch < set.pairs, numbers);
  }
  return all;
}

TEST(PatchOrder, MakesCachesMissFewerVerticesOfTheSamePatchesWithTheSameTexels) {
  const BakedPatches grid = makeGrid(kRows - 4);
  const std::vector<uint32_t> shuffled = shuffle(grid), ordered = orderPatches(grid, shuffled);
  EXPECT_GT(missesPerTriangle(grid, shuffled), 1.5);
  EXPECT_LT(missesPerTriangle(grid, ordered), 0.9) << "half a vertex for each triangle is the least";
  const SceneFromPart place{0.5, {1, 2, 3}};
  EXPECT_EQ(listPatches(compressPatches(grid, ordered, place, Bc4Effort::fast)),
            listPatches(compressPatches(grid, shuffled, place, Bc4Effort::fast)));
}

TEST(PatchOrder, IsTheSameForTheSamePatches) {
  const BakedPatches grid = makeGrid(kRows - 4);
  const std::vector<uint32_t> shuffled = shuffle(grid), ordered = orderPatches(grid, shuffled);
  EXPECT_EQ(orderPatches(grid, shuffled), ordered);
  EXPECT_NE(ordered, shuffled);
  const std::vector<uint32_t> some(shuffled.begin(), shuffled.begin() + 5);
  std::vector<uint32_t> others = orderPatches(grid, some);
  EXPECT_TRUE(std::is_permutation(others.begin(), others.end(), some.begin(), some.end())) << "of the given ones alone";
  EXPECT_TRUE(orderPatches(grid, {}).empty());
}

// Adds a cube of squares around the origin that rays see from outside, and whose corners have no common orientation.
void addCube(double halfEdge, int squares, BakedPatches& to) {
  const RandomStream random(2, 0);
  for (int side = 0; side < 6; ++side) {
    Vec3d normal = Vec3d::Zero(), u = Vec3d::Zero(), v = Vec3d::Zero();
    normal[side % 3] = side < 3 ? 1 : -1;
    u[(side + 1) % 3] = v[(side + 2) % 3] = 1;
    const auto corner = [&](int i, int j) -> Vec3d {
      return halfEdge * (normal + (2.0 * i / squares - 1) * u + (2.0 * j / squares - 1) * v);
    };
    for (int i = 0; i < squares; ++i)
      for (int j = 0; j < squares; ++j) {
        std::array<Vec3d, 4> corners = {corner(i, j), corner(i + 1, j), corner(i, j + 1), corner(i + 1, j + 1)};
        if (random.below(to.patches(), 2) == 0) std::swap(corners[1], corners[2]);
        addPatch(corners, -normal, 0, to);
      }
  }
}

TEST(PatchOrder, PutsWhatHidesOthersFirst) {
  BakedPatches cubes;
  cubes.patchEdge = kEdge;
  addCube(1, 6, cubes);
  const uint32_t inner = cubes.patches();
  addCube(2, 6, cubes);
  cubes.pairs = cubes.patches();
  std::vector<uint32_t> numbers(cubes.patches());
  std::iota(numbers.begin(), numbers.end(), 0);
  const std::vector<uint32_t> ordered = orderPatches(cubes, numbers);
  EXPECT_TRUE(std::is_partitioned(ordered.begin(), ordered.end(), [&](uint32_t patch) { return patch >= inner; }))
      << "the outer cube hides the inner one";
}

TEST(PatchOrder, HoldsPatchesWithEqualAndWithFlatTriangles) {
  BakedPatches patches = makeGrid(kRows);
  const std::vector<double> first(patches.vertices.begin(), patches.vertices.begin() + 12);
  std::copy(first.begin(), first.end(), patches.vertices.begin() + 12);              // the second equals the first
  std::fill_n(patches.vertices.begin() + 24, 12, 3.0);                               // the third is a point
  std::copy_n(patches.vertices.begin() + 36, 3, patches.vertices.begin() + 36 + 9);  // the fourth is folded
  const std::vector<uint32_t> numbers = shuffle(patches), ordered = orderPatches(patches, numbers);
  EXPECT_TRUE(std::is_permutation(ordered.begin(), ordered.end(), numbers.begin(), numbers.end()));
}

}  // namespace
}  // namespace tessera
