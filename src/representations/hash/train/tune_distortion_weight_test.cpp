#include "representations/hash/train/tune_distortion_weight.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "representations/hash/testing/hash_cube.h"
#include "representations/hash/train/train_hash.h"

namespace tessera {
namespace {

constexpr size_t kProbes = 3;

class DistortionTuning : public testing::Test {
 protected:
  DistortionTuning() : device_(makeDevice({"cpu", 2})) {
    options_.config = smallHashConfig();
    options_.config.lodStepFraction = 0;
    options_.config.distortionWeight.reset();
    options_.grid = cubeGrid();
    options_.loop.steps = 40;
    options_.loop.progress = false;
  }
  TrainingResult train() { return trainHash(*device_, scene_.capture(), model_, options_); }
  // Trains until this many probes are recorded and then stops. Returns whether the training was stopped.
  bool trainUntil(size_t probes) {
    options_.loop.stopRequested = [this, probes] { return recordedProbes().size() >= probes; };
    const bool finished = train().finished;
    options_.loop.stopRequested = [] { return false; };
    return !finished;
  }
  nlohmann::json file() const { return nlohmann::json::parse(readTextFile(distortionFile(model_))); }
  nlohmann::json recordedProbes() const {
    const bool isRecorded = fs::exists(distortionFile(model_)) && file().is_object();
    return isRecorded ? file().at("probes") : nlohmann::json::array();
  }
  double saved() const { return savedConfig<HashConfig>(model_).distortionWeight.value(); }

  CubeScene scene_;
  const fs::path model_ = scene_ / "model";
  const std::unique_ptr<Device> device_;
  TrainHashOptions options_;
};

TEST(DistortionSearch, TakesABoundedFractionOfTheTraining) {
  const auto of = [](int64_t steps, double minutes) {
    TrainingLoopOptions loop;
    loop.steps = steps;
    loop.minutes = minutes;
    return distortionSearch("cpu", loop);
  };
  EXPECT_EQ(of(10000, 0).steps, kProbeShare * 10000);
  EXPECT_EQ(of(0, 0).steps, kProbeShare * kDefaultSteps);
  EXPECT_EQ(of(100, 0).steps, kMinProbeSteps);
  EXPECT_EQ(of(1000000, 0).steps, kMaxProbeSteps);
  EXPECT_EQ(of(0, 10).minutes, kProbeShare * 10);
  EXPECT_EQ(of(0, 10).steps, 0);
  EXPECT_EQ(of(0, 1000).minutes, kMaxProbeMinutes);
}

TEST_F(DistortionTuning, RunsOnceAndRecordsItsResult) {
  train();
  const double chosen = saved();
  EXPECT_GT(chosen, 0) << "config.toml must have the number, so that the run can be repeated";
  EXPECT_EQ(file().at("chosen"), chosen);
  EXPECT_EQ(recordedProbes().size(), kProbes);
  EXPECT_EQ(file().at("steps"), kMinProbeSteps);

  // A resumed run does not need the file, whether the weight is auto or not.
  fs::remove(distortionFile(model_));
  options_.loop.resume = true;
  options_.loop.steps = 50;
  EXPECT_EQ(train().step, 50);
  options_.config = savedConfig<HashConfig>(model_);
  options_.loop.steps = 60;
  EXPECT_EQ(train().step, 60);
  EXPECT_EQ(saved(), chosen);
  EXPECT_FALSE(fs::exists(distortionFile(model_))) << "the weight was determined again";
}

TEST_F(DistortionTuning, LeavesNoModelWhenStoppedAndResumesWithItsProbes) {
  EXPECT_TRUE(trainUntil(1));
  EXPECT_FALSE(ModelFolder(model_).manifest());
  EXPECT_FALSE(file().contains("chosen"));
  const nlohmann::json known = recordedProbes();
  ASSERT_LT(known.size(), kProbes);
  // Pretend that the first probe was better than any can be.
  nlohmann::json better = file();
  better["probes"][0]["psnr"] = 99;
  writeFileAtomically(distortionFile(model_), better.dump());
  options_.loop.resume = true;
  EXPECT_TRUE(train().finished);
  EXPECT_EQ(recordedProbes().size(), kProbes);
  EXPECT_EQ(recordedProbes()[0]["psnr"], 99);
  EXPECT_EQ(saved(), known[0]["distortion"].get<double>());
}

TEST_F(DistortionTuning, IgnoresMalformedFilesAndThoseOfOtherSettings) {
  // Expects the first probe to be run again.
  const auto expectAnew = [&](const nlohmann::json& json) {
    writeFileAtomically(distortionFile(model_), json.dump());
    options_.loop.resume = true;
    const auto isMade = [&] {
      const nlohmann::json probes = recordedProbes();
      return !probes.empty() && probes[0]["psnr"].is_number() && probes[0]["psnr"] < 90;
    };
    options_.loop.stopRequested = isMade;
    EXPECT_FALSE(train().finished);
    EXPECT_TRUE(isMade());
    EXPECT_FALSE(ModelFolder(model_).manifest());
  };
  EXPECT_TRUE(trainUntil(1));
  nlohmann::json known = file();
  known["probes"][0]["psnr"] = 99;
  const auto changed = [&](const char* pointer, const nlohmann::json& value) {
    nlohmann::json other = known;
    other[nlohmann::json::json_pointer(pointer)] = value;
    return other;
  };
  expectAnew(changed("/probes/0/distortion", 0.5));
  expectAnew(changed("/probes/0/psnr", "99"));
  expectAnew(changed("/steps", -1));
  expectAnew(changed("/tuned_with_settings/learning_rate", "0.5"));
  expectAnew(changed("/tuned_with_settings/blocks", {2, 1}));
  expectAnew(changed("/tuned_with_settings/photos/0", "another.png"));
  expectAnew(nlohmann::json::array());
}

TEST_F(DistortionTuning, IsDiscardedByANewTraining) {
  EXPECT_TRUE(trainUntil(1));
  options_.config.distortionWeight = 0.05;
  train();
  EXPECT_FALSE(fs::exists(distortionFile(model_)));
  EXPECT_EQ(savedConfig<HashConfig>(model_).distortionWeight, 0.05);
  // A resumed run keeps a weight that was given by hand.
  options_.config.distortionWeight.reset();
  options_.loop.resume = true;
  options_.loop.steps = 50;
  EXPECT_EQ(train().step, 50);
  EXPECT_EQ(savedConfig<HashConfig>(model_).distortionWeight, 0.05);
  // The user has changed config.toml.
  writeFileAtomically(model_ / "config.toml", configToToml(options_.config.fields()));
  EXPECT_THROW(train(), Error);
}

TEST_F(DistortionTuning, CountsTowardsTheTimeBudget) {
  options_.loop.steps = 0;
  options_.loop.minutes = 0.1;
  TrainingLoopOptions loop = options_.loop;
  fs::create_directories(model_);
  const BlockGrid grid = cubeGrid();
  const auto start = std::chrono::steady_clock::now();
  ASSERT_TRUE(tuneDistortionWeight({*device_, scene_.capture(), grid}, model_, options_.config, loop, [] {}));
  const std::chrono::duration<double, std::ratio<60>> spent = std::chrono::steady_clock::now() - start;
  EXPECT_GE(loop.minutes, std::max(0.01, 0.1 - spent.count()) - 1e-9);
  EXPECT_LT(loop.minutes, 0.1 - 0.01) << "the first probe alone takes this long";
}

}  // namespace
}  // namespace tessera
