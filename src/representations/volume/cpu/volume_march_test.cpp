#include "representations/volume/cpu/volume_march.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "raymarch/testing/random_parts.h"
#include "render/cpu/simd_target.h"
#include "representations/volume/testing/reference_volume.h"
#include "representations/volume/testing/test_volume_content.h"

namespace tessera {
namespace {

using tiles_test::randomVector;

constexpr MarchSettings kToTheEnd{true, 0};

ContentComposite marched(const VolumeContent& content, const SceneRay& ray, const RayRange& range,
                         const MarchSettings& settings, MarchCounts& counts,
                         std::vector<MarchedSample>* trace = nullptr) {
  ContentComposite composite;
  const VolumePath path = volumePath(content.parts[0], ray, range);
  VolumeMarch{content, content.parts[0], path, settings, 1, trace}.run(composite, counts);
  return composite;
}

// Random rays through bounded and contracted contents; the contracted one is placed like a background block.
template <class Check>
void forRandomRays(int rays, const Check& check) {
  for (const bool contracted : {false, true}) {
    VolumeContent content = makeVolumeContent({smoothPart(contracted ? 5 : 4, contracted)});
    if (contracted) content.parts[0].scale = {2, 3, 1};
    content.stepsPerTexel = contracted ? 1 : 3;
    const RandomStream random(3, contracted);
    for (uint64_t i = 0; i < static_cast<uint64_t>(rays); ++i) {
      const SceneRay ray{randomVector(random, 2 * i, contracted ? 6 : 2),
                         (randomVector(random, 2 * i + 1, 1) + Vec3d(0, 0, 1e-9)).normalized()};
      const RayRange range =
          contracted ? RayRange{0.05, i % 2 ? 30 : 1e6} : ownedRange(content.parts[0], ray, RayRange{0.05, 1e6});
      if (!range.empty()) check(content, ray, range);
    }
  }
}

void expectMatchesDefinition() {
  int compared = 0;
  double opacities = 0;
  forRandomRays(150, [&](const VolumeContent& content, const SceneRay& ray, const RayRange& range) {
    MarchCounts counts;
    const ContentComposite actual = marched(content, ray, range, kToTheEnd, counts);
    ReferenceComposite expected;
    referenceMarch(content, content.parts[0], ray, range, expected);
    // A sample on the border of a macroblock may fall to either side.
    EXPECT_NEAR(static_cast<double>(counts.samples), expected.samples, 2);
    if (counts.samples != static_cast<uint64_t>(expected.samples)) return;
    for (int k = 0; k < 7; ++k) EXPECT_NEAR(actual.values[k], expected.values[k], 5e-4);
    EXPECT_NEAR(actual.transmittance, expected.transmittance, 5e-4);
    EXPECT_NEAR(actual.depth, expected.depth, 1e-3 * (1 + expected.depth));
    opacities += 1 - expected.transmittance;
    ++compared;
  });
  EXPECT_GT(compared, 150);
  EXPECT_GT(opacities / compared, 0.2);
  EXPECT_LT(opacities / compared, 0.99);
}

TEST(VolumeMarch, MatchesTheDefinitionWithEveryInstructionSet) {
  int targets = 0;
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    SCOPED_TRACE(renderSimdTarget());
    EXPECT_STREQ(renderSimdTarget(), hwy::TargetName(target));
    expectMatchesDefinition();
    ++targets;
  }
  hwy::SetSupportedTargetsForTest(0);
  EXPECT_GE(targets, 1);
}

TEST(VolumeMarch, EvaluatesTheSameSamplesWithAndWithoutSkipping) {
  MarchCounts skipping, whole;
  forRandomRays(3000, [&](const VolumeContent& content, const SceneRay& ray, const RayRange& range) {
    std::vector<MarchedSample> few, all;
    const ContentComposite a = marched(content, ray, range, {true, 0}, skipping, &few);
    const ContentComposite b = marched(content, ray, range, {false, 0}, whole, &all);
    ASSERT_EQ(few.size(), all.size());
    for (size_t i = 0; i < few.size(); ++i) {
      ASSERT_EQ(few[i].segment, all[i].segment);
      ASSERT_EQ(few[i].step, all[i].step);
      ASSERT_EQ(few[i].opacity, all[i].opacity);
      ASSERT_EQ(few[i].distance, all[i].distance);
    }
    for (int k = 0; k < 7; ++k) ASSERT_EQ(a.values[k], b.values[k]);
    ASSERT_EQ(a.transmittance, b.transmittance);
  });
  EXPECT_EQ(skipping.samples, whole.samples);
  EXPECT_LT(skipping.steps, whole.steps);
  EXPECT_GT(skipping.samples, 10000u);
}

TEST(VolumeMarch, CrossesEmptySpaceInAFewSteps) {
  VolumePart part = smoothPart(1, false, 0);
  part.distances.assign(part.distances.size(), 8);
  const VolumeContent content = makeVolumeContent({part});
  const SceneRay ray{Vec3d(-1, 0.1, 0.2), Vec3d(1, 0.1, 0.05).normalized()};
  MarchCounts skipping, whole;
  marched(content, ray, {0, 2}, {true, 0}, skipping);
  marched(content, ray, {0, 2}, {false, 0}, whole);
  EXPECT_LE(skipping.steps, 2u);
  EXPECT_EQ(whole.steps, 64u);
  EXPECT_EQ(skipping.samples + whole.samples, 0u);
}

TEST(VolumeMarch, TakesStepsOfOneTexelFromHalfAStepBehindTheEntry) {
  VolumeContent content = makeVolumeContent({smoothPart(1, false, 1)});
  std::vector<MarchedSample> trace;
  MarchCounts counts;
  marched(content, {Vec3d(-1, 0, 0), Vec3d::UnitX()}, {0.25, 1.27}, {true, 0}, counts, &trace);
  const double texel = 2.0 / 64;
  ASSERT_EQ(trace.size(), 33u);  // 1.02 / texel = 32.64
  for (size_t i = 0; i < 32; ++i) EXPECT_NEAR(trace[i].distance, 0.25 + (i + 0.5) * texel, 1e-6);
  EXPECT_NEAR(trace[32].distance, 0.5 * (0.25 + 32 * texel + 1.27), 1e-6);  // the last step is shorter
}

TEST(VolumeMarch, SeesNothingWhereTheMacroblockIsEmptyWhateverThePlanesHold) {
  VolumePart part = smoothPart(1, false, 1);
  for (std::vector<uint8_t>& plane : part.planeBytes) std::fill(plane.begin(), plane.end(), uint8_t{255});
  const VolumeContent full = makeVolumeContent({part});
  part.macroblocks.assign(part.macroblocks.size(), VolumePart::kEmpty);
  const VolumeContent empty = makeVolumeContent({part});
  const SceneRay ray{Vec3d(-1, 0, 0), Vec3d::UnitX()};
  MarchCounts counts;
  EXPECT_LT(marched(full, ray, {0, 2}, kToTheEnd, counts).transmittance, 1e-3);
  counts = {};
  EXPECT_EQ(marched(empty, ray, {0, 2}, kToTheEnd, counts).transmittance, 1);
  EXPECT_EQ(counts.samples, 0u);
  EXPECT_EQ(counts.steps, 64u);
}

// One step at a time, at positions that floats represent exactly, up to the borders of the domain and across those of
// macroblocks.
TEST(VolumeMarch, InterpolatesTexelsToFloatPrecision) {
  VolumePart part = smoothPart(9, false, 1);
  for (std::vector<uint8_t>& plane : part.planeBytes) {  // rough, so that reading a wrong neighbour shows
    for (size_t i = 0; i < plane.size(); ++i) plane[i] = static_cast<uint8_t>(plane[i] - 16 + i / 8 * 37 % 32);
  }
  for (const float density : {14.0f, 9.0f}) {
    VolumeContent content = makeVolumeContent({part});
    content.densityRange = density;
    const RandomStream random(6, 1);
    const double texel = 2.0 / part.planes;
    int seen = 0;
    for (uint64_t i = 0; i < 3000; ++i) {
      const int axis = static_cast<int>(random.below(8 * i, 3));
      const uint32_t step = random.below(8 * i + 1, part.planes);
      SceneRay ray{Vec3d::Zero(), Vec3d::Unit(axis)};
      Triple<double> p;
      for (int a = 0; a < 3; ++a) {
        const uint32_t at =
            random.below(8 * i + 2 + a, 4) == 0 ? 1024 * random.below(8 * i + 5, 2) : random.below(8 * i + 5 + a, 1024);
        p[a] = a == axis ? (step + 0.5) / part.planes : at / 1024.0;
        ray.origin[a] = a == axis ? -1 : 2 * p[a] - 1;
      }
      MarchCounts counts;
      const ContentComposite actual = marched(content, ray, {step * texel, (step + 1) * texel}, kToTheEnd, counts);
      double sums[8];
      const bool stored = referenceSums(content, part, p, sums);
      ASSERT_EQ(counts.samples, stored ? 1u : 0u);
      if (!stored) continue;
      const double opacity = -std::expm1(-std::exp(std::min(sums[0] - 1, 15.0)) * texel);
      ASSERT_NEAR(1 - actual.transmittance, opacity, 2e-6);
      for (int k = 0; k < 7; ++k) ASSERT_NEAR(actual.values[k], opacity / (1 + std::exp(-sums[k + 1])), 2e-6) << k;
      seen += opacity > 0.02 && opacity < 0.98;
    }
    EXPECT_GT(seen, 300) << density;
  }
}

// If all four sources have one value, sums are four times that value, also where lookups are clamped.
TEST(VolumeMarch, SumsFourSourcesUpToTheBordersOfTheDomain) {
  VolumePart part;
  part.voxels = 32;
  part.planes = 64;
  makeVolume(part, {[](const Texel3&, int attribute) { return attribute == 0 ? 140 : 120 + 4 * attribute; },
                    [](int, uint32_t, uint32_t, int attribute) { return attribute == 0 ? 140 : 120 + 4 * attribute; },
                    [](const Texel3&) { return true; }});
  const VolumeContent content = makeVolumeContent({part});
  const double density = std::exp(4 * (-14 + 28 * 140 / 255.0) - 1);
  for (const double edge : {-0.9999, -0.99, 0.0, 0.99, 0.9999}) {
    MarchCounts counts;
    const ContentComposite actual =
        marched(content, {Vec3d(-1, edge, edge), Vec3d::UnitX()}, {0, 2}, kToTheEnd, counts);
    EXPECT_EQ(counts.samples, 64u);
    const double opacity = -std::expm1(-density * 2);
    EXPECT_NEAR(1 - actual.transmittance, opacity, 1e-4);
    for (int k = 0; k < 7; ++k) {
      EXPECT_NEAR(actual.values[k], opacity / (1 + std::exp(-4 * (-7 + 14 * (124 + 4 * k) / 255.0))), 1e-4) << k;
    }
  }
}

TEST(VolumeMarch, EndsWhereNothingMoreWouldBeSeen) {
  const VolumeContent content = makeVolumeContent({smoothPart(8, false, 1)});
  const SceneRay ray{Vec3d(-1, 0.3, 0.1), Vec3d::UnitX()};
  MarchCounts all, some, none;
  const ContentComposite whole = marched(content, ray, {0, 2}, {true, 0}, all);
  const ContentComposite ended = marched(content, ray, {0, 2}, {true, 0.5f}, some);
  ASSERT_LT(whole.transmittance, 0.4);
  EXPECT_LT(ended.transmittance, 0.5);
  EXPECT_LT(some.samples, all.samples);
  for (int k = 0; k < 7; ++k) EXPECT_NEAR(ended.values[k], whole.values[k], 0.5);
  ContentComposite composite;
  const VolumePath path = volumePath(content.parts[0], ray, {0, 2});
  VolumeMarch{content, content.parts[0], path, {true, 0.5f}, 0.4f}.run(composite, none);
  EXPECT_EQ(none.steps, 0u);
}

TEST(VolumeMarch, TreatsTheDensestTexelsAsOpaqueAndFinite) {
  VolumePart part = smoothPart(1, true, 1);
  std::fill(part.voxelBytes.begin(), part.voxelBytes.end(), uint8_t{255});
  for (std::vector<uint8_t>& plane : part.planeBytes) std::fill(plane.begin(), plane.end(), uint8_t{255});
  const VolumeContent content = makeVolumeContent({part});
  MarchCounts counts;
  const ContentComposite actual = marched(content, {Vec3d(0, 0, 0), Vec3d::UnitX()}, {0.05, 1e6}, kToTheEnd, counts);
  EXPECT_EQ(actual.transmittance, 0);
  for (const float value : actual.values) EXPECT_NEAR(value, 1, 1e-5);
}

}  // namespace
}  // namespace tessera
