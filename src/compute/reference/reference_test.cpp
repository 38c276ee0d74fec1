// Compares the reference functions with values computed by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "compute/adam.h"
#include "compute/composite.h"
#include "compute/deferred.h"
#include "compute/losses.h"
#include "compute/rays.h"
#include "compute/reference/functions.h"

namespace tessera::reference {
namespace {

TEST(SphericalHarmonics, HaveTinyCudaNnsOrderAndSigns) {
  const double direction[3] = {0.48, -0.6, 0.64};
  const Doubles expected = {0.2820948,  0.2931615,  0.3127056,  -0.2345292, -0.3146539, 0.4195386,
                            0.0721616,  -0.3356309, -0.0707971, 0.1172535,  -0.5327975, 0.2873904,
                            -0.2273689, -0.2299123, -0.1198794, 0.2406245};
  const Doubles values = sphericalHarmonics(4, direction);
  ASSERT_EQ(values.size(), expected.size());
  for (size_t i = 0; i < values.size(); ++i) EXPECT_NEAR(values[i], expected[i], 1e-7) << i;
}

TEST(SphericalHarmonics, HaveTheSameNormInEveryDirection) {
  const RandomStream random(3, 0);
  for (uint64_t i = 0; i < 100; ++i) {
    const double z = 2 * random.uniformDouble(2 * i) - 1, angle = 6.2831853 * random.uniformDouble(2 * i + 1);
    const double r = std::sqrt(1 - z * z), direction[3] = {r * std::cos(angle), r * std::sin(angle), z};
    for (int degree = 1; degree <= 4; ++degree) {
      double sum = 0;
      for (double value : sphericalHarmonics(degree, direction)) sum += value * value;
      EXPECT_NEAR(sum, degree * degree / (4 * 3.14159265358979), 1e-12);
    }
  }
}

TEST(FrequencyEncoding, PutsTheInputThenSinesThenCosines) {
  const double x[2] = {0.3, -0.7};
  const Doubles values = frequencyEncoding(2, 2, x);
  const Doubles expected = {0.3,           -0.7,           std::sin(0.3), std::sin(-0.7), std::sin(0.6), std::sin(-1.4),
                            std::cos(0.3), std::cos(-0.7), std::cos(0.6), std::cos(-1.4)};
  ASSERT_EQ(values.size(), expected.size());
  for (size_t i = 0; i < values.size(); ++i) EXPECT_NEAR(values[i], expected[i], 1e-15);
}

TEST(Contraction, MapsKnownPairsBothWays) {
  const std::pair<Point, Point> pairs[] = {{{2, 1, -.5}, {1.5, .5, -.25}},
                                           {{-4, 3, 1}, {-1.75, .75, .25}},
                                           {{1, -10, 2}, {.1, -1.9, .2}},
                                           {{1e6, 0, 0}, {1.999999, 0, 0}},
                                           {{.3, -1, .2}, {.3, -1, .2}}};
  for (const auto& [x, y] : pairs)
    for (int a = 0; a < 3; ++a) {
      EXPECT_NEAR(contract(x)[a], y[a], 1e-12);
      EXPECT_NEAR(uncontract(y)[a], x[a], 1e-4 * std::max(1e-8, std::abs(x[a])));
    }
}

TEST(Contraction, StretchesAtMost1Point932TimesAndMostAtACorner) {
  const auto largestStretch = [](const Point& x) {  // the norm of the Jacobian, by its columns and power iteration
    double jacobian[3][3];
    for (int column = 0; column < 3; ++column) {
      Point after = x, before = x;
      after[column] += 1e-6;
      before[column] -= 1e-6;
      for (int row = 0; row < 3; ++row) jacobian[row][column] = (contract(after)[row] - contract(before)[row]) / 2e-6;
    }
    Point v = {0.5, 0.6, -0.7};
    double length = 0;
    for (int i = 0; i < 200; ++i) {
      Point u{}, w{};
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) u[r] += jacobian[r][c] * v[c];
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) w[c] += jacobian[r][c] * u[r];
      length = std::hypot(w[0], w[1], w[2]);
      for (int a = 0; a < 3; ++a) v[a] = w[a] / length;
    }
    return std::sqrt(length);
  };
  const RandomStream random(4, 0);
  for (uint64_t i = 0; i < 200; ++i) {
    Point x;
    for (int a = 0; a < 3; ++a) x[a] = 6 * random.uniformDouble(3 * i + a) - 3;
    EXPECT_LE(largestStretch(x), 1.932);
  }
  EXPECT_NEAR(largestStretch({1 + 1e-5, 1 - 1e-5, 1 - 1e-5}), 1.9319, 1e-3);
}

TEST(Contraction, KeepsLinesStraightWithinARegion) {
  const Point o = {1.5, 0.2, -0.3}, d = {0.7, 0.3, 0.2};
  const auto at = [&](double t) { return contract({o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]}); };
  const Point a = at(0), b = at(4), middle = at(1.3);
  const double share = (middle[0] - a[0]) / (b[0] - a[0]);
  for (int axis = 1; axis < 3; ++axis) EXPECT_NEAR(middle[axis], a[axis] + share * (b[axis] - a[axis]), 1e-12);
}

TEST(Composite, WeightsAndRemainingTransmittanceSumToOne) {
  const RandomStream random(5, 0);
  for (Extinction extinction : {Extinction::opacity, Extinction::density, Extinction::logDensity}) {
    Doubles x(20), steps(20), distances(20), colours(60, 1.0);
    for (size_t i = 0; i < x.size(); ++i) {
      x[i] = 0.9 * random.uniformDouble(3 * i);
      steps[i] = random.uniformDouble(3 * i + 1);
      distances[i] = static_cast<double>(i);
    }
    const RayColour ray = compositeRay(extinction, 0, {x, steps, distances, colours, {1, 1, 1}});
    double sum = 0, transmittance = 1;
    for (size_t i = 0; i < x.size(); ++i) {
      sum += ray.weights[i];
      transmittance *= 1 - computeOpacity(extinction, x[i], steps[i]);
    }
    EXPECT_NEAR(sum + transmittance, 1, 1e-14);
    EXPECT_NEAR(ray.opacity, sum, 1e-14);
    for (double channel : ray.colour) EXPECT_NEAR(channel, 1, 1e-14) << "white before white is white";
  }
}

TEST(Composite, NeverDividesByTheTransparencyOfAnOpaqueSample) {
  const Doubles x = {0.5, 1, 0.5}, distances = {1, 2, 3}, colours = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const RaySamples samples{x, {}, distances, colours, {}};
  const RayGradients gradients = compositeRayBackward(Extinction::opacity, 0, samples, {1, 1, 1}, 0, 0, {});
  EXPECT_DOUBLE_EQ(gradients.x[0], 0);  // a light of 1 arrives with or without this sample
  EXPECT_DOUBLE_EQ(gradients.x[1], 0.5 * (1 - 0.5));
  EXPECT_DOUBLE_EQ(gradients.x[2], 0);
  EXPECT_DOUBLE_EQ(gradients.colours[8], 0);
}

TEST(Composite, StopsAfterTheSampleThatTakesTransmittanceBelowTheMinimum) {
  const Doubles x = {0.5, 0.9, 0.5}, distances = {1, 2, 3}, colours(9, 1.0);
  const RaySamples samples{x, {}, distances, colours, {}};
  const RayColour ray = compositeRay(Extinction::opacity, 0.1, samples);
  EXPECT_EQ(ray.weights[1], 0.5 * 0.9);
  EXPECT_EQ(ray.weights[2], 0);
  EXPECT_DOUBLE_EQ(ray.opacity, 0.95);
  EXPECT_EQ(compositeRayBackward(Extinction::opacity, 0.1, samples, {1, 1, 1}, 0, 0, {}).x[2], 0);
}

TEST(DeferredNetwork, StoresWeightsByLayerOutputAndInputFollowedByBiases) {
  Doubles network(DeferredNetwork::kParameters);
  const auto weight = [&](uint32_t layer, uint32_t inputs, uint32_t output, uint32_t input) -> double& {
    return network[DeferredNetwork::kWeights[layer] + output * inputs + input];
  };
  weight(0, 34, 5, 2) = 2;         // composited
  weight(0, 34, 5, 7) = 0.5;       // direction x
  weight(0, 34, 5, 10 + 3) = -1;   // sin 2x
  weight(0, 34, 5, 22 + 11) = 3;   // cos 8z
  weight(0, 34, 0, 34 * 16) = .1;  // bias of the first unit
  weight(1, 16, 3, 5) = 0.7;
  weight(1, 16, 4, 0) = -1;  // keeps the unit at zero
  weight(2, 16, 1, 3) = 0.4;
  weight(2, 16, 1, 4) = 100;
  network.back() = -0.2;  // bias of blue
  const Doubles composited = {0, 0, 0.6, 0, 0, 0, 0};
  const double direction[3] = {0.6, 0, 0.8};
  const double unit = 2 * 0.6 + 0.5 * 0.6 - std::sin(1.2) + 3 * std::cos(6.4);
  const Point colour = deferredForward(network, composited, direction);
  EXPECT_NEAR(colour[0], 0.5, 1e-15);
  EXPECT_NEAR(colour[1], 1 / (1 + std::exp(-0.4 * 0.7 * unit)), 1e-14);
  EXPECT_NEAR(colour[2], 1 / (1 + std::exp(0.2)), 1e-15);
  const DeferredGradients gradients = deferredBackward(network, composited, direction, {0, 1, 0});
  EXPECT_NEAR(gradients.composited[2], colour[1] * (1 - colour[1]) * 0.4 * 0.7 * 2, 1e-14);
}

TEST(Blending, WeightsTheGatedSpecularColourOfABlockByItsOpacity) {
  const Doubles composited = {.1, .2, .3, 0, 0, 0, 0, .4, .5, .6, 0, 0, 0, 0}, specular = {1, 0, 0, 0, 1, 0};
  const Doubles opacities = {.25, .5}, depths = {1, 4};
  const RaySegments segments{composited, specular, opacities, depths};
  const BlendedRay gated = blendRay(false, segments), printed = blendRay(true, segments);
  EXPECT_NEAR(gated.colour[0], .1 + .25 + .75 * .4, 1e-15);
  EXPECT_NEAR(gated.colour[1], .2 + .75 * (.5 + .5), 1e-15);
  EXPECT_NEAR(printed.colour[0], .1 + 1 + .75 * .4, 1e-15);
  EXPECT_NEAR(printed.colour[1], .2 + .75 * (.5 + 1), 1e-15);
  EXPECT_NEAR(gated.opacity, 1 - .75 * .5, 1e-15);
  EXPECT_NEAR(gated.depth, 1 + .75 * 4, 1e-15);
}

// The centre of each texel of each side is at a direction that is easy to write down.
TEST(CubeMap, HasTheColourOfATexelInItsDirection) {
  const uint32_t resolution = 4;
  Doubles texels(6 * 4 * 4 * 3);
  for (size_t i = 0; i < texels.size(); ++i) texels[i] = static_cast<double>(i);
  const double places[4] = {-1, -1.0 / 3, 1.0 / 3, 1};
  const double within = 1 - 1e-9;  // of the side, so that edges belong to no other
  size_t texel = 0;
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {1.0, -1.0})
      for (const double v : places)
        for (const double u : places) {
          Point direction{};
          direction[axis] = 7 * sign;
          direction[(axis + 1) % 3] = 7 * within * u;
          direction[(axis + 2) % 3] = 7 * within * v;
          const Point colour = cubeMapColour(resolution, texels, direction);
          for (size_t channel = 0; channel < 3; ++channel)
            EXPECT_NEAR(colour[channel], texels[3 * texel + channel], 1e-6) << "texel " << texel;
          ++texel;
        }
}

TEST(CubeMap, MixesTheFourTexelsAroundADirection) {
  Doubles texels(6 * 2 * 2 * 3);
  const size_t side = 3;  // -y, whose columns are along z and rows along x
  for (size_t i = 0; i < 4; ++i) texels[3 * (4 * side + i)] = std::array{1.0, 10.0, 100.0, 1000.0}[i];
  // Column (0.5 + 1) / 2 = 0.75, row (-0.5 + 1) / 2 = 0.25.
  EXPECT_NEAR(cubeMapColour(2, texels, {-1, -2, 1})[0], 0.75 * (0.25 + 7.5) + 0.25 * (25 + 750), 1e-12);
}

TEST(CubeMap, GivesEqualComponentsToTheFirstAxisAndNothingToZero) {
  Doubles texels(6 * 2 * 2 * 3);
  for (size_t i = 0; i < texels.size(); ++i) texels[i] = static_cast<double>(i / 12);  // the number of the side
  EXPECT_EQ(cubeMapColour(2, texels, {-2, 2, 2})[0], 1);
  EXPECT_EQ(cubeMapColour(2, texels, {1, -2, 2})[0], 3);
  EXPECT_EQ(cubeMapColour(2, texels, {0, 0, -2})[0], 5);
  EXPECT_TRUE(cubeMapTexels(2, {0, 0, 0}).empty());
}

TEST(ColourLoss, HasTheValuesOfItsFormulas) {
  EXPECT_NEAR(colourLoss(ColourLossKind::charbonnier, 1e-3, 0.001).value, 0.0014142136, 1e-10);
  EXPECT_NEAR(colourLoss(ColourLossKind::charbonnier, 1e-3, 0.1).value, 0.1000050, 1e-7);
  EXPECT_NEAR(colourLoss(ColourLossKind::huber, 0.1, 0.05).value, 0.0125, 1e-15);
  EXPECT_NEAR(colourLoss(ColourLossKind::huber, 0.1, -0.3).value, 0.25, 1e-15);
  EXPECT_EQ(colourLoss(ColourLossKind::huber, 0.1, -0.3).slope, -1);
  EXPECT_EQ(colourLoss(ColourLossKind::mse, 0, 0.5).value, 0.25);
  EXPECT_EQ(colourLoss(ColourLossKind::mse, 0, 0.5).slope, 1);
}

TEST(ColourLoss, HasNoKinkForHuber) {
  for (const double delta : {0.1, 1.0}) {
    for (const double sign : {-1.0, 1.0}) {
      const ValueAndSlope inside = colourLoss(ColourLossKind::huber, delta, sign * delta * (1 - 1e-9)),
                          outside = colourLoss(ColourLossKind::huber, delta, sign * delta * (1 + 1e-9));
      EXPECT_NEAR(inside.value, outside.value, 1e-8);
      EXPECT_NEAR(inside.slope, outside.slope, 1e-8);
      EXPECT_NEAR(outside.slope, sign, 1e-12);
    }
  }
}

TEST(Distortion, MatchesTheTabulatedValues) {
  const Doubles fences = {0, .1, .3, .35, .7, 1}, weights = {.05, .2, .4, .1, .05};
  const Doubles slopes = {.458333, .271667, .183333, .393333, .835};
  const LossAndGradients result = distortionOfFences(fences, weights);
  EXPECT_NEAR(result.loss, 0.1158333, 1e-7);
  for (size_t i = 0; i < slopes.size(); ++i) EXPECT_NEAR(result.gradients[i], slopes[i], 1e-6);
}

TEST(Distortion, EqualsThatOfTheWarpedFencesOfARay) {
  const Doubles steps = {0.2, 0.5, 1.1, 4}, weights = {0.1, 0.3, 0.2, 0.4};
  Doubles distances, fences = {warpDistance(0.3)};
  double t = 0.3;
  for (double step : steps) {
    distances.push_back(t + step / 2);
    t += step;
    fences.push_back(warpDistance(t));
  }
  EXPECT_NEAR(distortionOfRay(weights, distances, steps).loss, distortionOfFences(fences, weights).loss, 1e-14);
  EXPECT_EQ(warpDistance(1), 0.5);
  EXPECT_EQ(warpDistance(4), 0.875);
}

TEST(Distortion, EqualsThatOfTheFencesOnNormalisedDistances) {
  const Doubles fences = {0, .1, .3, .35, .7, 1}, weights = {.05, .2, .4, .1, .05};
  Doubles distances, steps;
  for (size_t i = 0; i < weights.size(); ++i) {
    distances.push_back((fences[i] + fences[i + 1]) / 2);
    steps.push_back(fences[i + 1] - fences[i]);
  }
  EXPECT_NEAR(distortionOfRay(weights, distances, steps, true).loss, 0.1158333, 1e-7);
  EXPECT_LT(distortionOfRay(weights, distances, steps).loss, 0.1);
}

TEST(S3im, UsesTheGivenOrderFirstAndThenRandomOrders) {
  EXPECT_EQ(s3imOrder(5, 0, 7), (std::vector<uint32_t>{0, 1, 2, 3, 4}));
  const std::vector<uint32_t> first = s3imOrder(100, 0, 7), second = s3imOrder(100, 1, 7);
  EXPECT_TRUE(std::is_permutation(second.begin(), second.end(), first.begin()));
  EXPECT_NE(second, first);
  EXPECT_NE(second, s3imOrder(100, 2, 7));
  EXPECT_NE(second, s3imOrder(100, 1, 8));
  EXPECT_EQ(second, s3imOrder(100, 1, 7));
}

TEST(S3im, ComparesMeansWhereNothingVaries) {
  double x[16], y[16];
  std::fill_n(x, 16, 0.3);
  std::fill_n(y, 16, 0.6);
  EXPECT_NEAR(ssimOfGroup(x, y).loss, (2 * 0.3 * 0.6 + 1e-4) / (0.3 * 0.3 + 0.6 * 0.6 + 1e-4), 1e-6);
}

TEST(S3im, IsTheMeanOverGroupsAndChannels) {
  Doubles x(3 * 40), y(3 * 40);  // two groups; the last eight rays are left over
  for (size_t i = 0; i < x.size(); ++i) {
    x[i] = i < 3 * 16 && i % 3 == 1 ? 0.3 : 0.6;
    y[i] = i < 3 * 32 ? 0.6 : 0;
  }
  const double similarity = (2 * 0.3 * 0.6 + 1e-4) / (0.3 * 0.3 + 0.6 * 0.6 + 1e-4);
  EXPECT_NEAR(s3imLoss(x, y, {}, 1, 0).loss, (1 - similarity) / 6, 1e-6);
  EXPECT_EQ(s3imLoss(View(x).first(45), View(y).first(45), {}, 3, 0).loss, 0) << "fewer than 16 rays";
}

TEST(March, SamplesExactlyTheLatticePointsInOccupiedCells) {
  // Only one cell is occupied: the samples are those whose contracted middle lies in its box, without gaps.
  MarchSpace space{.contracted = true, .gridResolution = 8, .far = 20, .minStep = 0.01f, .cone = 0};
  const Point origin = {-0.3, 0.1, 0.2}, direction = {0.6, 0, 0.8};
  std::vector<uint32_t> occupancy(8 * 8 * 8 / 32);
  const uint32_t x = 4, y = 4, z = 6;  // contracted [0,.5) × [0,.5) × [1,1.5)
  const uint32_t cell = x + 8 * (y + 8 * z);
  occupancy[cell / 32] = 1u << cell % 32;
  const std::vector<MarchSample> samples = marchRay(space, origin, direction, 0.25, 1e9, occupancy);
  ASSERT_GT(samples.size(), 10u);
  // In this cell m = z goes from 1 to 2, that is t from 1 to 2.25; x/m stays below 1/2 until
  // -.3 + .6 t = (.2 + .8 t) / 2, that is t = 2.
  EXPECT_NEAR(samples.front().distance, 1, 0.011);
  EXPECT_NEAR(samples.back().distance, 2, 0.011);
  for (size_t i = 1; i < samples.size(); ++i) EXPECT_EQ(samples[i].step, samples[i - 1].step + 1);
  for (const MarchSample& sample : samples) {
    EXPECT_NEAR(sample.distance, (static_cast<double>(sample.step) + 0.75) * space.minStep, 1e-12);
    EXPECT_EQ(sample.cell, cell);
  }
}

TEST(Adam, MovesByTheRateAtTheFirstStep) {
  Adam options;
  options.rate = 0.01f;
  AdamState state{1, 0, 0, 0};
  adamStep(options, 1e-3, state);  // m / sqrt(v) is sign(g), both corrected
  EXPECT_NEAR(state.parameter, 1 - 0.01, 1e-8);
  EXPECT_EQ(state.count, 1u);
}

}  // namespace
}  // namespace tessera::reference
