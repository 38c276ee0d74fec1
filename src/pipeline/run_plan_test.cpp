#include "pipeline/run_plan.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace tessera {
namespace {

constexpr int64_t kMiB = 1 << 20;

// Measured with COLMAP on two cores, whose speed at that time the seconds of features tell.
struct MeasuredRun {
  MatchingSize size;
  MatchingRates rates;
  double mapping, adjusting;     // seconds
  double featureMiB, mapperMiB;  // peaks
};
const MeasuredRun kMeasuredRuns[] = {
    {{18, 1600 * 900, 153, 203632, 48098, 2}, {50.0 / 18, 175.0 / 153, 11313, 600}, 19, 2, 866, 76},
    {{50, 540 * 960, 445, 226292, 168503, 2}, {45.0 / 50, 137.0 / 445, 4526, 600}, 29, 6, 332, 130},
    {{202, 800 * 600, 3541, 830645, 781563, 2}, {287.0 / 202, 1119.0 / 3541, 4112, 400}, 223, 41, 309, 487},
};

TEST(RunPlan, IsWithinHalfOfWhatPosesTook) {
  for (const MeasuredRun& run : kMeasuredRuns) {
    const MatchingNeeds needs = planMatching(run.size, run.rates);
    EXPECT_GT(needs.mapping.seconds, run.mapping / 1.5);
    EXPECT_LT(needs.mapping.seconds, run.mapping * 1.5);
    EXPECT_LT(needs.adjusting.seconds, run.adjusting * 1.5 + 2);
    EXPECT_GT(needs.adjusting.seconds, run.adjusting / 1.5 - 2);
    EXPECT_DOUBLE_EQ(needs.matches.seconds, static_cast<double>(run.size.pairs) * run.rates.secondsPerPair);
  }
}

TEST(RunPlan, StatesMemoryAboveWhatPosesTookAndBelowTwice) {
  for (const MeasuredRun& run : kMeasuredRuns) {
    const MatchingNeeds needs = planMatching(run.size, run.rates);
    EXPECT_GT(static_cast<double>(needs.features.memoryBytes) / kMiB, run.featureMiB);
    EXPECT_LT(static_cast<double>(needs.features.memoryBytes) / kMiB, 2 * run.featureMiB);
    EXPECT_GT(static_cast<double>(needs.mapping.memoryBytes) / kMiB, run.mapperMiB);
    EXPECT_LT(static_cast<double>(needs.mapping.memoryBytes) / kMiB, 2 * run.mapperMiB);
  }
}

TEST(RunPlan, ExpectsInliersBeforeTheyAreKnown) {
  MatchingSize size = kMeasuredRuns[2].size;
  const double known = planMatching(size, kMeasuredRuns[2].rates).mapping.seconds;
  size.inliers = 0;
  const double expected = planMatching(size, kMeasuredRuns[2].rates).mapping.seconds;
  EXPECT_GT(expected, known / 2);
  EXPECT_LT(expected, known * 2);
}

TEST(RunPlan, GrowsWithPhotosAndMinutes) {
  const TrainingCosts costs{.secondsPerStep = 0.1, .trainBytes = 500 * kMiB, .modelBytes = 100 * kMiB};
  TrainingSize size{.photos = 100,
                    .heldOut = 20,
                    .photoPixels = 1000 * 1000,
                    .sourcePixels = 4000 * 1000,
                    .sourceBytes = 1000 * kMiB,
                    .minutes = 10};
  const TrainingNeeds needs = planTraining(size, costs);
  EXPECT_NEAR(needs.train.seconds, 600, 20);
  EXPECT_GT(needs.train.memoryBytes, 500 * kMiB + 3 * 80 * size.photoPixels) << "eighty are in memory";
  EXPECT_EQ(needs.capture.diskBytes, 1000 * kMiB);
  size.photoPixels /= 16;
  EXPECT_LT(planTraining(size, costs).capture.diskBytes, 100 * kMiB);
  size.steps = 1000;
  size.relativeSeconds = 3;
  EXPECT_NEAR(planTraining(size, costs).train.seconds, 300, 20);
  size.heldOut = 0;
  EXPECT_EQ(planTraining(size, costs).evaluate.seconds, 0);
}

TEST(RunPlan, RefusesWhatDoesNotFit) {
  const RunPlan plan{{{"features", {60, 300 * kMiB, 200 * kMiB}}, {"train", {600, 4000 * kMiB, 900 * kMiB}}}};
  EXPECT_EQ(plan.total().seconds, 660);
  EXPECT_EQ(plan.total().memoryBytes, 4000 * kMiB);
  EXPECT_EQ(plan.total().diskBytes, 1100 * kMiB);
  const auto refusal = [&](int64_t freeBytes, int64_t memoryBytes) -> std::string {
    try {
      requireRoom(plan, "place", freeBytes, memoryBytes);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(refusal(1100 * kMiB, 4000 * kMiB), "");
  EXPECT_EQ(
      refusal(1000 * kMiB, 4000 * kMiB),
      "place: would take 1.2 GB, and 1.0 GB of its disk are free; name a folder on another disk, or make the photos "
      "smaller");
  EXPECT_EQ(refusal(1100 * kMiB, 2048 * kMiB),
            "stage train: would take 3.9 GiB of memory of 2.0 GiB; raise --downscale if it is `train`, else use fewer "
            "photos; or use a machine with more memory");
}

TEST(MatchingRates, AreReadBack) {
  const MatchingRates rates{1.5, 0.25, 5000.5, 321};
  const std::string text = encodeMatchingRates(rates, "these photos");
  const auto again = decodeMatchingRates(text, "these photos");
  ASSERT_TRUE(again.has_value());
  EXPECT_EQ(again->secondsPerPhoto, 1.5);
  EXPECT_EQ(again->secondsPerPair, 0.25);
  EXPECT_EQ(again->featuresPerPhoto, 5000.5);
  EXPECT_EQ(again->inliersPerPair, 321);
  EXPECT_FALSE(decodeMatchingRates(text, "others").has_value());
  EXPECT_FALSE(decodeMatchingRates(text.substr(0, 30), "these photos").has_value());
  EXPECT_FALSE(decodeMatchingRates("{\"of\": \"these photos\"}", "these photos").has_value());
  EXPECT_FALSE(decodeMatchingRates(encodeMatchingRates({-1, 1, 1, 1}, "x"), "x").has_value());
}

}  // namespace
}  // namespace tessera
