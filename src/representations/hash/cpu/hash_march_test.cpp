#include "representations/hash/cpu/hash_march.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "raymarch/cpu/part_path.h"
#include "representations/hash/testing/reference_hash.h"
#include "representations/hash/testing/test_hash_content.h"

namespace tessera {
namespace {

constexpr uint32_t kCells = 256;  // finer than the coarse grid of distances

HashContent scattered(bool contracted) {
  HashPart part;
  part.contracted = contracted;
  const RandomStream random(2, 2);
  uint64_t next = 0;
  makeHash(part, {16, kCells, 0, [&](const Vec3d&) { return random.below(next++, 1000) == 0; }}, smoothFeatures);
  HashContent content = makeHashContent({part}, testHashNetwork(1));
  content.step = 1.0f / 400;
  return content;
}

struct SkippingResult {
  MarchCounts counts;
  std::vector<uint64_t> samples;
  ContentComposite composite;
};

SkippingResult march(const HashContent& content, const HashFeatures& features, const SceneRay& ray,
                     const RayRange& range, const MarchSettings& settings) {
  SkippingResult result;
  HashRay one{partPath(content.parts[0], ray, range), 1, {}, &result.samples};
  HashRay* const rays[] = {&one};
  HashMarch{features, content.step, settings}.run(rays, result.counts);
  result.composite = one.composite;
  return result;
}

// For rays that begin very close to a cell's face or run along an axis, rounding may place the next face behind them.
TEST(HashMarch, EvaluatesTheSameSamplesFromFacesAndAlongAxes) {
  const RandomStream random(4, 4);
  size_t samples = 0;
  MarchCounts all, byCells, byDistances;
  for (const bool contracted : {false, true}) {
    const HashContent content = scattered(contracted);
    const HashFeatures features(content, content.parts[0]);
    const double half = content.parts[0].halfDomain();
    for (uint64_t number = 0; number < 3000; ++number) {
      SceneRay ray;
      for (uint64_t a = 0; a < 3; ++a) {
        const auto axis = static_cast<Eigen::Index>(a);
        const double face = random.below(8 * number + a, kCells) / static_cast<double>(kCells) * 2 * half - half;
        ray.origin[axis] = std::clamp(face, -0.99, 0.99) + 1e-5 * (random.uniformDouble(8 * number + a + 3) - 0.5);
        ray.direction[axis] = random.uniformDouble((uint64_t{1} << 40) + 8 * number + a) - 0.5;
      }
      if (number % 3 == 0) ray.direction = Vec3d::Unit(static_cast<Eigen::Index>(number / 3 % 3));
      if (number % 6 == 0) ray.direction = -ray.direction;
      ray.direction.normalize();
      const RayRange range = contracted ? RayRange{0, 50} : ownedRange(content.parts[0], ray, RayRange{0, 50});
      const SkippingResult slow = march(content, features, ray, range, {false, 0, false});
      const SkippingResult cells = march(content, features, ray, range, {true, 0, false});
      const SkippingResult fast = march(content, features, ray, range, {true, 0, true});
      ASSERT_EQ(cells.samples, slow.samples) << number;
      ASSERT_EQ(fast.samples, slow.samples) << number;
      ASSERT_EQ(fast.composite.transmittance, slow.composite.transmittance) << number;
      samples += slow.samples.size();
      all.steps += slow.counts.steps;
      byCells.steps += cells.counts.steps;
      byDistances.steps += fast.counts.steps;
    }
  }
  EXPECT_GT(samples, 1000u);
  EXPECT_LT(byCells.steps, all.steps / 2);
  EXPECT_LT(byDistances.steps, byCells.steps / 2);
}

TEST(HashMarch, EvaluatesTheSameSamplesInGridsThatAreNoPowersOfTwo) {
  const RandomStream random(6, 6);
  for (const uint32_t cells : {24u, 40u, 200u}) {
    HashPart part;
    part.contracted = true;
    uint64_t next = 0;
    makeHash(part, {24, cells, 0, [&](const Vec3d&) { return random.below(next++, 100) == 0; }}, smoothFeatures);
    HashContent content = makeHashContent({part}, testHashNetwork(1));
    content.step = 1.0f / 300;
    const HashFeatures features(content, content.parts[0]);
    size_t samples = 0;
    for (uint64_t number = 0; number < 500; ++number) {
      SceneRay ray;
      for (uint64_t a = 0; a < 3; ++a) {
        ray.origin[static_cast<Eigen::Index>(a)] = 4 * random.uniformDouble((uint64_t{1} << 40) + 6 * number + a) - 2;
        ray.direction[static_cast<Eigen::Index>(a)] = random.uniformDouble((uint64_t{1} << 41) + 6 * number + a) - 0.5;
      }
      ray.direction.normalize();
      const SkippingResult slow = march(content, features, ray, {0, 1e6}, {false, 0, false});
      ASSERT_EQ(march(content, features, ray, {0, 1e6}, {true, 0, false}).samples, slow.samples) << cells;
      ASSERT_EQ(march(content, features, ray, {0, 1e6}, {true, 0, true}).samples, slow.samples) << cells;
      samples += slow.samples.size();
    }
    EXPECT_GT(samples, 500u) << cells;
  }
}

// Very small and very large logits give weights of 0 and 1, whether they vary or not.
TEST(HashFeatures, WeighLevelsByLogitsOfAnySize) {
  for (const float logit : {-1e6f, -200.0f, -178.0f, -90.0f, 90.0f, 200.0f, 1e6f}) {
    HashPart part;
    makeHash(part, {16, 32, 0.5f}, smoothFeatures);
    for (size_t c = 8; c < 16; ++c) part.ranges[c] = {logit, logit};
    HashContent varying = makeHashContent({part}, testHashNetwork(1));
    HashContent constant = varying;
    constant.logits = {logit, logit};
    const HashFeatures a(varying, varying.parts[0]), b(constant, varying.parts[0]);
    const float place[3] = {0.3f, 0.6f, 0.55f};
    HashFeatures::Lookup lookup;
    float one[8], other[8];
    ASSERT_TRUE(a.find(place, lookup));
    a.mix(lookup, one);
    b.mix(lookup, other);
    for (int f = 0; f < 8; ++f) EXPECT_NEAR(one[f], other[f], 1e-5) << logit;
  }
}

TEST(HashMarch, MarchesEachRayIndependentlyOfTheOthers) {
  const HashContent content = scattered(false);
  const HashFeatures features(content, content.parts[0]);
  std::vector<HashRay> rays(40);
  std::vector<HashRay*> all;
  for (size_t i = 0; i < rays.size(); ++i) {
    const SceneRay ray{Vec3d(-0.9, 0.04 * static_cast<double>(i) - 0.8, 0.1), Vec3d(1, 0.1, 0.05).normalized()};
    rays[i].path = partPath(content.parts[0], ray, ownedRange(content.parts[0], ray, {0, 5}));
    all.push_back(&rays[i]);
  }
  std::vector<HashRay> alone = rays;
  MarchCounts together, apart;
  const HashMarch march{features, content.step, {}};
  march.run(all, together);
  for (HashRay& ray : alone) {
    HashRay* const one[] = {&ray};
    march.run(one, apart);
  }
  EXPECT_EQ(together.steps, apart.steps);
  EXPECT_EQ(together.samples, apart.samples);
  for (size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ(rays[i].composite.transmittance, alone[i].composite.transmittance);
    EXPECT_EQ(rays[i].composite.depth, alone[i].composite.depth);
    for (int k = 0; k < 7; ++k) EXPECT_EQ(rays[i].composite.values[k], alone[i].composite.values[k]);
  }
}

TEST(HashMarch, MatchesTheReferenceDefinition) {
  for (const bool contracted : {false, true}) {
    HashPart part;
    part.contracted = contracted;
    makeHash(part, {16, 32, 0.5f}, smoothFeatures);
    const HashContent content = makeHashContent({part}, testHashNetwork(1));
    const HashFeatures features(content, content.parts[0]);
    const SceneRay ray{Vec3d(-0.7, -0.6, 0.4), Vec3d(1, 0.7, -0.5).normalized()};
    const RayRange range = contracted ? RayRange{0.05, 30} : ownedRange(part, ray, {0.05, 10});
    const SkippingResult result = march(content, features, ray, range, {true, 0, true});
    ReferenceComposite expected;
    referenceMarch(content, part, ray, range, expected);
    EXPECT_EQ(result.counts.samples, static_cast<uint64_t>(expected.samples));
    EXPECT_NEAR(result.composite.transmittance, expected.transmittance, 1e-5);
    EXPECT_NEAR(result.composite.depth, expected.depth, 1e-4);
    for (int k = 0; k < 7; ++k) EXPECT_NEAR(result.composite.values[k], expected.values[k], 1e-4);
  }
}

}  // namespace
}  // namespace tessera
