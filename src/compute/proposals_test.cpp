// Properties of proposals that must hold on every device, and values computed by hand.
#include "compute/proposals.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "compute/device_test.h"

namespace tessera::device_test {
namespace {

class Proposals : public testing::TestWithParam<std::string> {
 protected:
  Device& device() const { return *deviceNamed(GetParam()); }

  std::vector<float> resampled(const std::vector<float>& fences, const std::vector<float>& weights, uint32_t after,
                               float anneal = 1, float uniformFraction = 0.01f) const {
    Stage stage(device(), 1);
    ResampleFences a;
    a.rays = {1};
    a.before = static_cast<uint32_t>(weights.size());
    a.after = after;
    a.anneal = anneal;
    a.uniformFraction = uniformFraction;
    a.fences = stage.input(fences);
    a.weights = stage.input(weights);
    a.resampled = stage.output("resampled", after + 1);
    stage.device.run(a);
    return stage.device.read(a.resampled);
  }

  struct Loss {
    float loss;
    std::vector<float> gradients;
  };
  Loss interlevel(const std::vector<float>& fences, const std::vector<float>& weights,
                  const std::vector<float>& sampleFences, const std::vector<float>& sampleWeights) const {
    Stage stage(device(), 1);
    std::vector<float> middles, widths;
    for (size_t i = 0; i + 1 < sampleFences.size(); ++i) {
      middles.push_back((sampleFences[i] + sampleFences[i + 1]) / 2);
      widths.push_back(sampleFences[i + 1] - sampleFences[i]);
    }
    InterlevelLoss a;
    a.rays = {1};
    a.intervals = static_cast<uint32_t>(weights.size());
    a.fences = stage.input(fences);
    a.weights = stage.input(weights);
    a.firstSample = stage.input(std::vector<uint32_t>{0, static_cast<uint32_t>(middles.size())});
    a.middles = stage.input(middles);
    a.widths = stage.input(widths);
    a.sampleWeights = stage.input(sampleWeights);
    a.loss = stage.output("loss", 1);
    a.weightGradients = stage.output("weightGradients", weights.size());
    stage.device.run(a);
    return {stage.device.read(a.loss)[0], stage.device.read(a.weightGradients)};
  }
};

std::vector<float> evenFences(uint32_t intervals) {
  std::vector<float> fences;
  for (uint32_t i = 0; i <= intervals; ++i) fences.push_back(static_cast<float>(i) / static_cast<float>(intervals));
  return fences;
}

TEST_P(Proposals, AreResampledEvenlyWhereWeightsAreEqualOrZero) {
  for (float weight : {0.0f, 0.3f})
    for (float anneal : {1.0f, 0.3f}) {
      const std::vector<float> fences = resampled(evenFences(64), std::vector<float>(64, weight), 32, anneal);
      ASSERT_EQ(fences.size(), 33u);
      for (size_t i = 0; i < fences.size(); ++i) EXPECT_NEAR(fences[i], static_cast<double>(i) / 32, 1e-6);
    }
}

TEST_P(Proposals, PutNearlyAllFencesIntoTheOneHeavyBin) {
  for (uint32_t heavy : {0u, 17u, 63u}) {
    std::vector<float> weights(64);
    weights[heavy] = 0.2f;
    const std::vector<float> fences = resampled(evenFences(64), weights, 300);
    const float from = static_cast<float>(heavy) / 64, to = from + 1.0f / 64;
    const auto within = std::count_if(fences.begin(), fences.end(), [&](float s) { return s >= from && s <= to; });
    EXPECT_NEAR(static_cast<double>(within), 0.99 * 301, 4);
    EXPECT_LT(within, 299) << "the padding puts some fences elsewhere";
    const std::vector<float> all = resampled(evenFences(64), weights, 300, 1, 0);
    EXPECT_GE(all[1], from);
    EXPECT_LE(all[299], to);
  }
}

TEST_P(Proposals, KeepFencesSortedAndWithinTheRay) {
  Random random(3);
  for (int n = 0; n < 100; ++n) {
    std::vector<float> fences = random.floats(65, 0, 1), weights = random.floats(64, 0, 1);
    std::sort(fences.begin(), fences.end());
    fences.front() = 0;
    fences.back() = 1;
    for (float& weight : weights) weight = weight < 0.5f ? 0 : weight * weight * weight;
    const std::vector<float> newFences =
        resampled(fences, weights, 48, n % 2 == 0 ? 1.0f : 0.5f, n % 3 == 0 ? 0 : 0.01f);
    EXPECT_TRUE(std::is_sorted(newFences.begin(), newFences.end()));
    EXPECT_EQ(newFences.front(), 0) << "the fences cover the whole ray";
    EXPECT_EQ(newFences.back(), 1);
  }
}

TEST_P(Proposals, AreAnnealedTowardsUniformity) {
  std::vector<float> weights(4, 0.01f);
  weights[1] = 0.16f;
  // The shares of sqrt(w) are 1/7, 4/7, 1/7 and 1/7.
  const std::vector<float> fences = resampled(evenFences(4), weights, 7, 0.5f, 0);
  for (int i = 1; i <= 5; ++i) EXPECT_NEAR(fences[i], 0.25 + 0.25 * (i - 1) / 4, 1e-6);
  EXPECT_NEAR(fences[6], 0.75, 1e-6);
}

TEST_P(Proposals, ArePenalisedWhereTheyDoNotBoundTheSamples) {
  const Loss known =
      interlevel({0, .2f, .5f, 1}, {.1f, .3f, .4f}, {0, .1f, .3f, .35f, .7f, 1}, {.05f, .2f, .4f, .1f, .05f});
  // Only the third sample has more weight than its bound: .4 instead of .3, in the second bin.
  EXPECT_NEAR(known.loss, 0.0249999925, 1e-8);
  EXPECT_EQ(known.gradients[0], 0);
  EXPECT_NEAR(known.gradients[1], -0.5, 1e-6);
  EXPECT_EQ(known.gradients[2], 0);
}

TEST_P(Proposals, AreNotPenalisedWhereTheyBoundTheSamples) {
  Random random(4);
  for (int n = 0; n < 20; ++n) {
    std::vector<float> fences = random.floats(17, 0, 1);
    std::sort(fences.begin(), fences.end());
    std::vector<float> weights = random.floats(16, 0, 1), half = weights;
    for (float& weight : half) weight *= 0.5f;
    const Loss bound = interlevel(fences, weights, fences, half);
    EXPECT_EQ(bound.loss, 0);
    for (float gradient : bound.gradients) EXPECT_EQ(gradient, 0);
    for (float& weight : weights) weight *= 0.1f;
    EXPECT_GT(interlevel(fences, weights, fences, half).loss, 0);
  }
}

INSTANTIATE_TEST_SUITE_P(Devices, Proposals, testing::Values("reference", "cpu with 2 threads"),
                         [](const auto& info) { return info.param.substr(0, info.param.find(' ')); });

}  // namespace
}  // namespace tessera::device_test
