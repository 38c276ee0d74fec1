// Properties of the lookup of hits in patches of texels that must hold on every device, independently of the reference.
#include "compute/patches.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "compute/device_test.h"

namespace tessera::device_test {
namespace {

static_assert(patchPermutation(0) == std::array<uint32_t, 3>{0, 1, 2});
static_assert(patchPermutation(3) == std::array<uint32_t, 3>{1, 2, 0});
static_assert(patchPermutationNumber({2, 0, 1}) == 4);

TEST(PatchPermutations, AreSixAndNumberedByTheirInverse) {
  std::set<std::array<uint32_t, 3>> all;
  for (uint32_t number = 0; number < kPatchPermutations; ++number) {
    const std::array<uint32_t, 3> permutation = patchPermutation(number);
    EXPECT_EQ(std::set<uint32_t>(permutation.begin(), permutation.end()), (std::set<uint32_t>{0, 1, 2}));
    EXPECT_EQ(patchPermutationNumber(permutation), number);
    all.insert(permutation);
  }
  EXPECT_EQ(all.size(), 6u);
}

// The place of a hit in its patch, in units of texels, as its texels and weights say.
struct PlaceInPatch {
  double column = 0, row = 0, weight = 0;
  double beyond = 0;  // weight of the texels beyond the diagonal, which a patch without a second triangle does not have
};

class PatchLookup : public testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    selectSimdTarget(GetParam());
    device = deviceNamed(GetParam());
    if (device == nullptr) GTEST_SKIP() << "this machine has no device \"" << GetParam() << "\"";
  }
  void TearDown() override { selectSimdTarget({}); }

  // Each hit is on a face of its own, whose place is places[i]. All texels must be of the patch of their face.
  std::vector<PlaceInPatch> look(uint32_t patchEdge, const std::vector<uint32_t>& places,
                                 const std::vector<float>& barycentrics, const std::vector<float>& factors = {}) {
    Stage stage(*device, 71);
    const uint32_t hits = static_cast<uint32_t>(places.size()), perPatch = patchEdge * patchEdge;
    std::vector<uint32_t> faces(hits);
    for (uint32_t i = 0; i < hits; ++i) faces[i] = i;
    PatchTexels a;
    a.samples = {hits};
    a.patchEdge = patchEdge;
    a.patchOfFace = stage.input(places);
    a.faces = stage.input(faces);
    a.barycentrics = stage.input(barycentrics);
    a.cornerFactors = stage.input(factors);
    a.texels = stage.outputWords("texels", size_t{4} * hits);
    a.weights = stage.output("weights", size_t{4} * hits);
    device->run(a);
    const std::vector<uint32_t> texels = device->read(a.texels);
    const std::vector<float> weights = device->read(a.weights);
    std::vector<PlaceInPatch> at(hits);
    for (size_t i = 0; i < texels.size(); ++i) {
      EXPECT_EQ(texels[i] / perPatch, places[i / 4] == kNoPatch ? 0 : places[i / 4] / 16);
      EXPECT_GE(weights[i], 0);
      PlaceInPatch& place = at[i / 4];
      place.column += weights[i] * (texels[i] % perPatch % patchEdge);
      place.row += weights[i] * (texels[i] % perPatch / patchEdge);
      place.weight += weights[i];
      if (texels[i] % perPatch % patchEdge + texels[i] % perPatch / patchEdge > patchEdge) place.beyond += weights[i];
    }
    return at;
  }
  Device* device = nullptr;
};

TEST_P(PatchLookup, PlacesVerticesAtTheCornersOfThePatch) {
  constexpr uint32_t kTriangles[2][3] = {{0, 1, 2}, {3, 2, 1}};
  for (const uint32_t patchEdge : {2u, 9u, 64u}) {
    std::vector<uint32_t> places, corners;
    std::vector<float> barycentrics;
    for (const uint32_t triangle : {0u, 1u})
      for (uint32_t number = 0; number < kPatchPermutations; ++number)
        for (uint32_t vertex = 0; vertex < 3; ++vertex) {
          places.push_back(16 * 5 + 8 * triangle + number);
          corners.push_back(kTriangles[triangle][patchPermutation(number)[vertex]]);
          for (const uint32_t other : {1u, 2u}) barycentrics.push_back(vertex == other ? 1.0f : 0.0f);
        }
    const std::vector<PlaceInPatch> at = look(patchEdge, places, barycentrics);
    for (size_t i = 0; i < at.size(); ++i) {
      EXPECT_EQ(at[i].column, corners[i] % 2 ? patchEdge - 1 : 0) << i;
      EXPECT_EQ(at[i].row, corners[i] / 2 ? patchEdge - 1 : 0) << i;
      EXPECT_EQ(at[i].weight, 1) << i;
    }
  }
}

TEST_P(PatchLookup, MeetsTexelsExactly) {
  // A quarter of the way from corner 0 to corner 1, and three quarters to corner 2; from corner 3 in the second
  // triangle.
  const std::vector<PlaceInPatch> at = look(5, {16, 16 + kSecondTriangle}, {0.25f, 0.75f, 0.25f, 0.75f});
  EXPECT_EQ(at[0].column, 1);
  EXPECT_EQ(at[0].row, 3);
  EXPECT_EQ(at[1].column, 3);
  EXPECT_EQ(at[1].row, 1);
}

TEST_P(PatchLookup, LimitsHitsOutsideTheirFaceToThePatch) {
  const std::vector<PlaceInPatch> at = look(5, {0, kSecondTriangle}, {-0.01f, 1.02f, -0.01f, 1.02f});
  EXPECT_EQ(at[0].column, 0);
  EXPECT_EQ(at[0].row, 4);
  EXPECT_EQ(at[1].column, 4);
  EXPECT_EQ(at[1].row, 0);
}

TEST_P(PatchLookup, GivesFacesWithoutAPatchNoWeight) {
  const std::vector<PlaceInPatch> at = look(5, {kNoPatch, 16}, {0.2f, 0.3f, 0.2f, 0.3f});
  EXPECT_EQ(at[0].weight, 0);
  EXPECT_NEAR(at[1].weight, 1, 1e-6);
}

// A quarter of the hits lie on the triangle's longest edge, and some hits a thousandth of a texel beyond it.
TEST_P(PatchLookup, MixesOnlyTexelsOnTheTriangle) {
  constexpr size_t kHits = 20000;
  for (const uint32_t patchEdge : {2u, 8u, 9u, 32u, 64u}) {
    Random random(77);
    const float noise = 1e-3f / static_cast<float>(patchEdge - 1);
    std::vector<float> barycentrics;
    for (size_t i = 0; i < kHits; ++i) {
      const float second = random.uniform(0, 1), third = i % 4 == 0 ? 1 - second : random.uniform(0, 1 - second);
      barycentrics.push_back(second + random.uniform(-noise, noise));
      barycentrics.push_back(third + random.uniform(-noise, noise));
    }
    const std::vector<PlaceInPatch> at = look(patchEdge, std::vector<uint32_t>(kHits, 16), barycentrics);
    for (size_t i = 0; i < kHits; ++i) {
      const double second = barycentrics[2 * i], third = barycentrics[2 * i + 1];
      ASSERT_NEAR(at[i].weight, 1, 1e-6);
      ASSERT_LE(at[i].beyond, std::max(0.0, second + third - 1) * (patchEdge - 1) + 1e-5) << second << ' ' << third;
      ASSERT_NEAR(at[i].column, second * (patchEdge - 1), 2e-3);
      ASSERT_NEAR(at[i].row, third * (patchEdge - 1), 2e-3);
    }
  }
}

// The last homogeneous coordinate of a grid position under a map to the scene, and the position in the scene.
struct SceneCorner {
  double x, y, factor;
};
SceneCorner sceneCorner(double u, double v) {
  const double w = 0.4 + 0.5 * u + 0.3 * v;
  return {(2 * u + 0.3 * v + 1) / w, (0.2 * u + 1.5 * v - 0.5) / w, w};
}

// A triangle in the plane of grid coordinates and its image in the scene: a hit's place in the patch is linear in the
// scene, not in the grid.
TEST_P(PatchLookup, InterpolatesLinearlyInTheSceneWhereTheGridIsProjective) {
  constexpr double kCorners[3][2] = {{0.1, 0.2}, {0.9, 0.3}, {0.4, 1.1}};
  const uint32_t patchEdge = 9;
  SceneCorner corners[3];
  std::vector<float> factors(8, 1), barycentrics;
  for (size_t i = 0; i < 3; ++i) {
    corners[i] = sceneCorner(kCorners[i][0], kCorners[i][1]);
    factors[4 + i] = static_cast<float>(corners[i].factor);
  }
  Random random(72);
  for (int i = 0; i < 50; ++i) {
    const float second = random.uniform(0, 0.7f);
    barycentrics.push_back(second);
    barycentrics.push_back(random.uniform(0, 1 - second));
  }
  const std::vector<PlaceInPatch> at =
      look(patchEdge, std::vector<uint32_t>(barycentrics.size() / 2, 16), barycentrics, factors);
  double farthest = 0;  // of the place without factors
  for (size_t i = 0; i < at.size(); ++i) {
    const double second = barycentrics[2 * i], third = barycentrics[2 * i + 1], first = 1 - second - third;
    const SceneCorner hit = sceneCorner(first * kCorners[0][0] + second * kCorners[1][0] + third * kCorners[2][0],
                                        first * kCorners[0][1] + second * kCorners[1][1] + third * kCorners[2][1]);
    const double u = at[i].column / (patchEdge - 1), v = at[i].row / (patchEdge - 1);
    EXPECT_NEAR(corners[0].x + u * (corners[1].x - corners[0].x) + v * (corners[2].x - corners[0].x), hit.x, 1e-5);
    EXPECT_NEAR(corners[0].y + u * (corners[1].y - corners[0].y) + v * (corners[2].y - corners[0].y), hit.y, 1e-5);
    farthest = std::max(farthest, std::abs(u - second));
  }
  EXPECT_GT(farthest, 0.05);
}

// Lists the texels of a batch and mixes rows of numbers that are computed from their ids.
TEST_P(PatchLookup, MixesTheRowsThatItLists) {
  const uint32_t samples = 300, idCount = 500;
  for (const bool hasAllRows : {true, false}) {
    Stage stage(*device, 73);
    std::vector<uint32_t> ids = stage.random.wordsBelow(size_t{4} * samples, idCount);
    const std::vector<float> weights = stage.random.floats(ids.size(), 0, 1);
    const std::set<uint32_t> distinct(ids.begin(), ids.end());
    const auto count = static_cast<uint32_t>(distinct.size());
    DistinctRows list;
    list.samples = {samples};
    list.ids = stage.input(ids);
    list.idCount = idCount;
    list.rowCapacity = hasAllRows ? count : count / 2;
    list.marks = stage.outputWords("marks", list.words());
    list.ranks = stage.outputWords("ranks", list.words());
    list.rowCount = stage.outputWords("rowCount", 1);
    list.rowIds = stage.outputWords("rowIds", list.rowCapacity);
    list.rows = stage.outputWords("rows", ids.size());
    device->run(list);
    EXPECT_EQ(device->read(list.rowCount)[0], count);
    const std::vector<uint32_t> rowIds = device->read(list.rowIds);
    EXPECT_TRUE(std::equal(rowIds.begin(), rowIds.end(), distinct.begin()));
    std::vector<float> numbers;
    for (const uint32_t id : rowIds) numbers.push_back(0.01f * static_cast<float>(id));
    MixRowsForward mix;
    mix.samples = {samples};
    mix.inputRows = {list.rowCapacity, list.rowCount};
    mix.rows = list.rows;
    mix.weights = stage.input(weights);
    mix.input = stage.makeMatrix(numbers, 1, Layout::plain);
    mix.output = stage.outputMatrix("output", samples, 1, Layout::plain);
    device->run(mix);
    const std::vector<float> mixed = device->read(mix.output.data);
    for (size_t s = 0; s < samples; ++s) {
      double expected = 0;
      for (size_t k = 4 * s; k < 4 * s + 4; ++k)
        if (ids[k] <= rowIds.back()) expected += 0.01 * weights[k] * ids[k];
      EXPECT_NEAR(mixed[s], expected, 1e-4) << s;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, PatchLookup, testing::ValuesIn(deviceNames()), [](const auto& info) {
  std::string name = info.param;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
});

}  // namespace
}  // namespace tessera::device_test
