#include "pipeline/run_plan.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "base/error.h"
#include "base/image_io.h"
#include "base/random.h"
#include "base/testing/shared_data.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

constexpr int64_t kMiB = 1 << 20;

// Measured with COLMAP on two cores without other work: `ROWS="killed fox sizes survey untagged" bench/photos.sh`.
// Adjusting took so long in the first four before it was repeated without outlying observations, with which it
// takes 1.1 to 1.9 times as long.
struct MeasuredRun {
  MatchingSize size;
  MatchingRates rates;
  double matches, mapping, adjusting;  // seconds
  double featureMiB, mapperMiB;        // peaks
};
const MeasuredRun kMeasuredRuns[] = {
    {{18, 1600 * 900, 153, 203632, 48098, 2}, {43.4 / 18, 86.5 / 153, 1600 * 900, 11313, 600}, 86.5, 9.7, 1.3, 866, 76},
    {{50, 540 * 960, 720, 226292, 212386, 2}, {0.791, 0.2927, 540 * 960, 5350, 544}, 144.6, 23.3, 4.2, 332, 129},
    {{122, 800 * 600, 1526, 457041, 376511, 2}, {0.601, 0.1028, 800 * 600, 2149, 333}, 268.5, 92.2, 13.3, 310, 265},
    {{487, 800 * 600, 6084, 2020359, 1647016, 2},
     {0.639, 0.1523, 800 * 600, 2656, 418},
     1330.9,
     452.9,
     77.2,
     311,
     1086},
    {{202, 800 * 600, 2397, 830675, 675417, 2}, {0.6213, 0.22296, 800 * 600, 3108, 444}, 699, 159, 35, 309, 460},
    {{202, 800 * 600, 3554, 830675, 896961, 2}, {0.5231, 0.2022, 800 * 600, 3108, 442}, 1012, 215, 42, 309, 486},
    {{122, 800 * 600, 1529, 456992, 375748, 2}, {0.5179, 0.1468, 800 * 600, 2147, 333}, 435.8, 92.1, 20, 310, 268},
    {{487, 800 * 600, 6101, 2020416, 1651010, 2},
     {0.4717, 0.1657, 800 * 600, 2656, 417},
     1952.6,
     589.3,
     111.7,
     310,
     1059},
};

TEST(RunPlan, IsWithinHalfOfWhatPosesTook) {
  for (const MeasuredRun& run : kMeasuredRuns) {
    const MatchingNeeds needs = planMatching(run.size, run.rates);
    EXPECT_GT(needs.mapping.seconds, run.mapping / 1.5);
    EXPECT_LT(needs.mapping.seconds, run.mapping * 1.5);
    EXPECT_LT(needs.adjusting.seconds, run.adjusting * 1.5 + 2);
    EXPECT_GT(needs.adjusting.seconds, run.adjusting / 1.5 - 2);
    EXPECT_GT(needs.matches.seconds, run.matches / 1.5);
    EXPECT_LT(needs.matches.seconds, run.matches * 1.5);
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

TEST(RunPlan, ExpectsMoreThreadsThanPhotosThatWereTriedToBeFaster) {
  MatchingSize size = kMeasuredRuns[2].size;
  size.pixels = 10000;  // so that memory limits no thread
  const auto seconds = [&](int threads) {
    size.threads = threads;
    return planMatching(size, kMeasuredRuns[2].rates).features.seconds;
  };
  EXPECT_EQ(seconds(5), seconds(2)) << "as the photos that were tried took";
  EXPECT_NEAR(seconds(10), seconds(5) / 2, 1e-9);
}

TEST(RunPlan, ExpectsLongerMatchesIfThePhotosThatWereTriedHaveFewFeatures) {
  MatchingSize size = kMeasuredRuns[2].size;
  const double after = planMatching(size, kMeasuredRuns[2].rates).matches.seconds;
  size.features = 0;
  const double before = planMatching(size, kMeasuredRuns[2].rates).matches.seconds;
  EXPECT_NEAR(before, 1526 * 0.1028, 1);
  EXPECT_NEAR(after / before, 457041.0 / 122 / 2149, 1e-3);
}

TEST(RunPlan, StatesEnoughMemoryBeforeInliersAreKnown) {
  MatchingSize size = kMeasuredRuns[3].size;
  size.features = size.inliers = 0;
  const auto mebibytes = static_cast<double>(planMatching(size, kMeasuredRuns[3].rates).mapping.memoryBytes) / kMiB;
  EXPECT_GT(mebibytes, kMeasuredRuns[3].mapperMiB);
  EXPECT_LT(mebibytes, 2 * kMeasuredRuns[3].mapperMiB);
}

TEST(RunPlan, KnowsHowLongTheSearchForLookAlikesTakes) {
  // That of the fifty photos took 79 s.
  const double seconds = planMatching(kMeasuredRuns[1].size, kMeasuredRuns[1].rates).lookAlikes.seconds;
  EXPECT_GT(seconds, 79 / 1.3);
  EXPECT_LT(seconds, 79 * 1.3);
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

TEST(RunPlan, ExpectsStepsToTakeLongerUntilTheySettle) {
  TrainingCosts costs{.secondsPerStep = 0.1, .secondsPerLaterStep = 0.3};
  TrainingSize size{.photos = 10};
  const auto seconds = [&](int64_t steps) {
    size.steps = steps;
    return planTraining(size, costs).train.seconds;
  };
  EXPECT_NEAR(seconds(1500) - seconds(0), 1500 * 0.2, 1e-6);
  EXPECT_NEAR(seconds(300) - seconds(0), 300 * 0.12, 1e-6);
  EXPECT_NEAR(seconds(2500) - seconds(1500), 1000 * 0.3, 1e-6);
  const double start = seconds(0), fast = seconds(1000);
  costs.slowness = 2;
  EXPECT_NEAR(seconds(1000), 2 * fast - start, 1e-6);
}

TEST(RunPlan, AddsTheCoarserLevelsToTheMinutes) {
  TrainingCosts costs{.secondsPerStep = 0.1};
  const TrainingSize size{.photos = 100, .heldOut = 20, .photoPixels = 1000 * 1000, .minutes = 10};
  const double alone = planTraining(size, costs).train.seconds;
  costs.coarserLevels = 0.5;
  EXPECT_NEAR(planTraining(size, costs).train.seconds, alone + 300, 1e-6);
}

TEST(RunPlan, ExpectsBakingToBeAsSlowAsTrainingWas) {
  const TrainingCosts costs{.raysPerSecond = 10000, .bakeSeconds = 0, .secondsPerBakedMegapixel = 20};
  TrainingSize size{.photos = 100, .heldOut = 20, .photoPixels = 1000 * 1000, .minutes = 10, .relativeSeconds = 2};
  EXPECT_NEAR(planTraining(size, costs).bake.seconds, 2 * 1600, 10) << "on a machine of half the speed";
  size.raysPerSecond = 2500;
  EXPECT_NEAR(planTraining(size, costs).bake.seconds, 4 * 1600, 10);
}

TEST(RunPlan, MakesPhotosAsSmallAsTheTrainingOfAllTheirPixelsAsksFor) {
  TrainingCosts costs{.secondsPerStep = 0.1, .raysPerSecond = 30000};
  TrainingSize size{.photos = 18, .heldOut = 3, .sourcePixels = 1600 * 900, .longerSide = 1600, .minutes = 10};
  // 15 photos have 21.6 million pixels; training passes 18 million rays.
  EXPECT_EQ(chooseDownscale(size, costs), 2);
  size.minutes = 60;
  EXPECT_EQ(chooseDownscale(size, costs), 1);
  size.minutes = 3;
  EXPECT_EQ(chooseDownscale(size, costs), 4);
  size.minutes = 0.1;
  EXPECT_EQ(chooseDownscale(size, costs), 4) << "no smaller than 400 pixels";
  size.steps = 6000;  // of ten minutes
  EXPECT_EQ(chooseDownscale(size, costs), 2);
  size = {.photos = 20, .sourcePixels = 4000 * 3000, .longerSide = 4000, .minutes = 1e6};
  EXPECT_EQ(chooseDownscale(size, costs), 3) << "no larger than 1600 pixels";
  size = {.photos = 20, .sourcePixels = 320 * 240, .longerSide = 320, .minutes = 1e-3};
  EXPECT_EQ(chooseDownscale(size, costs), 1) << "they are small already";
  size = {.photos = 20, .sourcePixels = 0, .longerSide = 0, .minutes = 1};
  EXPECT_EQ(chooseDownscale(size, costs), 1) << "unknown";
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
            "--threads or "
            "photos; or use a machine with more memory");
}

TEST(RunPlan, OnlyWarnsOfWhatIsGuessed) {
  RunPlan plan{{{"train",
                 {.seconds = 600,
                  .memoryBytes = 4000 * kMiB,
                  .diskBytes = 900 * kMiB,
                  .guessedMemoryBytes = 1000 * kMiB,
                  .guessedDiskBytes = 500 * kMiB}}}};
  testing::internal::CaptureStderr();
  requireRoom(plan, "place", 500 * kMiB, 3500 * kMiB);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_NE(said.find("place: may take 0.9 GB, and 0.5 GB of its disk are free; how large the place is, is known when"),
            said.npos)
      << said;
  EXPECT_NE(said.find("stage train: may take 3.9 GiB of memory of 3.4 GiB"), said.npos) << said;
  EXPECT_THROW(requireRoom(plan, "place", 300 * kMiB, 3500 * kMiB), Error);
  EXPECT_THROW(requireRoom(plan, "place", 500 * kMiB, 2900 * kMiB), Error);
  const StageNeeds half = withoutDone(plan.entries[0].needs, 0.5);
  EXPECT_EQ(half.guessedDiskBytes, 250 * kMiB);
}

TEST(RunPlan, TellsWhatTheSizeOfThePlaceAdds) {
  const TrainingCosts certain{.trainBytes = 100 * kMiB, .modelBytes = 50 * kMiB};
  TrainingCosts guessed = certain;
  guessed.trainBytes += 400 * kMiB;
  guessed.modelBytes *= 4;
  const TrainingSize size{.photos = 100, .heldOut = 20, .photoPixels = 1000, .minutes = 10};
  const StageNeeds train = planGuessedTraining(size, guessed, certain).train;
  EXPECT_EQ(train.guessedMemoryBytes, 400 * kMiB);
  EXPECT_EQ(train.guessedDiskBytes, 150 * kMiB);
  EXPECT_EQ(train.diskBytes, 200 * kMiB);
}

PhotoList listOfSizes(const std::vector<std::pair<int, int>>& sizes) {
  PhotoList list;
  for (const auto& [width, height] : sizes) {
    const auto body = static_cast<int>(list.bodies.size());
    list.bodies.push_back({"camera", width, height, 0});
    list.photos.push_back({.name = "a.jpg", .safeName = fmt::format("{}.jpg", body), .file = {}, .body = body});
  }
  return list;
}

TEST(RunPlan, ExpectsFramesByWhatTheVideoStates) {
  const VideoStream video{.width = 1920, .height = 1080, .frames = 1800, .seconds = 60, .framesPerSecond = 30};
  const StageNeeds needs = planFrames(video, 100);
  EXPECT_GT(needs.seconds, 5);
  EXPECT_NEAR(static_cast<double>(needs.diskBytes), 100 * 1920 * 1080 * 0.5, 1);
  EXPECT_GT(planFrames(video, 1000).seconds, needs.seconds);
  EXPECT_EQ(planFrames(video, 10000).diskBytes, planFrames(video, 1800).diskBytes) << "it has no more";
  EXPECT_EQ(planFrames(video, 0).diskBytes, planFrames(video, 200).diskBytes);
  VideoStream uncounted = video;
  uncounted.frames = 0;
  EXPECT_EQ(planFrames(uncounted, 100).seconds, needs.seconds) << "length and rate tell as well";
  uncounted.seconds = 0;
  EXPECT_EQ(planFrames(uncounted, 100).seconds, 0);
}

TEST(RunPlan, ExpectsTimeForLookAlikesByTheNumberOfPhotosThatNeedThem) {
  MatchingSize size = kMeasuredRuns[3].size;
  const auto seconds = [&](int64_t photos) {
    size.forLookAlikes = photos;
    return planMatching(size, kMeasuredRuns[3].rates).lookAlikes.seconds;
  };
  EXPECT_GT(seconds(487) - seconds(0), 400 * (seconds(1) - seconds(0)));
  EXPECT_GT(seconds(1), seconds(0));
}

TEST(MatchingRates, GrowWithThePhotosIfTheyAreNotMeasured) {
  const MatchingRates small = expectRates(listOfSizes({{800, 600}, {800, 600}, {8000, 6000}}));
  EXPECT_EQ(small.secondsPerPhoto, MatchingRates().secondsPerPhoto);
  EXPECT_EQ(small.featuresPerPhoto, MatchingRates().featuresPerPhoto);
  const MatchingRates large = expectRates(listOfSizes({{4000, 3000}}));
  EXPECT_NEAR(large.pixelsPerPhoto, 3200 * 2400, 1) << "COLMAP reduces it";
  EXPECT_NEAR(large.secondsPerPhoto / small.secondsPerPhoto, 16, 1e-9);
  EXPECT_NEAR(large.featuresPerPhoto, 8192, 1e-9);
  EXPECT_NEAR(large.secondsPerPair / small.secondsPerPair, 8192 / small.featuresPerPhoto, 1e-9);
  EXPECT_NEAR(relativeSeconds(large), relativeSeconds(small), 1e-9);
}

// Photos that were cut, or taken at several focal lengths, have a camera each.
TEST(MatchingRates, AreMeasuredIfNoTwoPhotosAreOfOneCamera) {
  if (std::system("colmap help > /dev/null 2>&1") != 0) {
    ASSERT_FALSE(sharedDataIsRequired()) << "colmap is not installed";
    GTEST_SKIP() << "colmap is not installed";
  }
  const TemporaryFolder folder;
  std::vector<std::pair<int, int>> sizes;
  for (int i = 0; i < 15; ++i) sizes.emplace_back(200 + i, 150);
  PhotoList list = listOfSizes(sizes);
  for (ListedPhoto& photo : list.photos) {
    const CameraBody& body = list.bodies[static_cast<size_t>(photo.body)];
    photo.file = folder / photo.safeName;
    ImageU8 picture(body.width, body.height, 3);
    const RandomStream random(1, 0);
    for (int y = 0; y < picture.height; ++y) {
      for (int x = 0; x < picture.width; ++x) {
        const auto place = static_cast<uint64_t>(y / 8 * 100 + x / 8);
        std::fill_n(picture.at(x, y), 3, static_cast<uint8_t>(random.below(place, 256)));
      }
    }
    writeJpeg(photo.file, picture);
  }
  const MatchingRates rates = measureMatchingRates(list, 1, folder / "probe", [] {});
  EXPECT_GT(rates.secondsPerPair, 0);
  EXPECT_LT(rates.secondsPerPair, 100);
  EXPECT_NEAR(rates.pixelsPerPhoto, 207 * 150, 1) << "the five in the middle";
  EXPECT_GT(rates.featuresPerPhoto, 1);
  EXPECT_GT(rates.inliersPerPair, 1);
}

TEST(MatchingRates, AreReadBack) {
  const MatchingRates rates{1.5, 0.25, 1e6, 5000.5, 321};
  const std::string text = encodeMatchingRates(rates, "these photos");
  const auto again = decodeMatchingRates(text, "these photos");
  ASSERT_TRUE(again.has_value());
  EXPECT_EQ(again->secondsPerPhoto, 1.5);
  EXPECT_EQ(again->secondsPerPair, 0.25);
  EXPECT_EQ(again->pixelsPerPhoto, 1e6);
  EXPECT_EQ(again->featuresPerPhoto, 5000.5);
  EXPECT_EQ(again->inliersPerPair, 321);
  EXPECT_TRUE(decodeMatchingRates(text, "these ").has_value()) << "the key begins with it";
  EXPECT_FALSE(decodeMatchingRates(text, "these photos, and more").has_value());
  EXPECT_FALSE(decodeMatchingRates(text, "others").has_value());
  EXPECT_FALSE(decodeMatchingRates(text.substr(0, 30), "these photos").has_value());
  EXPECT_FALSE(decodeMatchingRates("{\"of\": \"these photos\"}", "these photos").has_value());
  EXPECT_FALSE(decodeMatchingRates(encodeMatchingRates({-1, 1, 1, 1, 1}, "x"), "x").has_value());
}

}  // namespace
}  // namespace tessera
