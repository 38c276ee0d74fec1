#include "representations/hash/train/find_distortion.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "representations/hash/testing/hash_cube.h"
#include "representations/hash/train/train_hash.h"

namespace tessera {
namespace {

constexpr size_t kProbes = 3;

class FindingDistortion : public testing::Test {
 protected:
  FindingDistortion() : device_(makeDevice({"cpu", 2})) {
    options_.config = smallHashConfig();
    options_.config.levelShare = 0;
    options_.config.distortion.reset();
    options_.grid = cubeGrid();
    options_.loop.steps = 40;
    options_.loop.progress = false;
  }
  TrainingResult train() { return trainHash(*device_, scene_.capture(), model_, options_); }
  // Asked to stop at the first question after so many probes. Whether it was.
  bool trainUntil(size_t probes) {
    options_.loop.stopRequested = [this, probes] { return told().size() >= probes; };
    const bool finished = train().finished;
    options_.loop.stopRequested = [] { return false; };
    return !finished;
  }
  nlohmann::json file() const { return nlohmann::json::parse(readTextFile(distortionFile(model_))); }
  nlohmann::json told() const {
    const bool isWhole = fs::exists(distortionFile(model_)) && file().is_object();
    return isWhole ? file().at("probes") : nlohmann::json::array();
  }
  double saved() const { return savedConfig<HashConfig>(model_).distortion.value(); }

  CubeScene scene_;
  const fs::path model_ = scene_ / "model";
  const std::unique_ptr<Device> device_;
  TrainHashOptions options_;
};

TEST(DistortionProbing, TakesAShareOfTheTrainingThatIsNeitherTooLittleNorTooMuch) {
  const auto of = [](int64_t steps, double minutes) {
    TrainingLoopOptions loop;
    loop.steps = steps;
    loop.minutes = minutes;
    return distortionProbing("cpu", loop);
  };
  EXPECT_EQ(of(10000, 0).steps, kProbeShare * 10000);
  EXPECT_EQ(of(0, 0).steps, kProbeShare * kDefaultSteps);
  EXPECT_EQ(of(100, 0).steps, kFewestProbeSteps);
  EXPECT_EQ(of(1000000, 0).steps, kMostProbeSteps);
  EXPECT_EQ(of(0, 10).minutes, kProbeShare * 10);
  EXPECT_EQ(of(0, 10).steps, 0);
  EXPECT_EQ(of(0, 1000).minutes, kMostProbeMinutes);
}

TEST_F(FindingDistortion, IsDoneOnceAndTold) {
  train();
  const double found = saved();
  EXPECT_GT(found, 0) << "config.toml says what a run is repeated with";
  EXPECT_EQ(file().at("chosen"), found);
  EXPECT_EQ(told().size(), kProbes);
  EXPECT_EQ(file().at("steps"), kFewestProbeSteps);

  // Whoever goes on need not know it, whether it is asked to be found out or not.
  fs::remove(distortionFile(model_));
  options_.loop.resume = true;
  options_.loop.steps = 50;
  EXPECT_EQ(train().step, 50);
  options_.config = savedConfig<HashConfig>(model_);
  options_.loop.steps = 60;
  EXPECT_EQ(train().step, 60);
  EXPECT_EQ(saved(), found);
  EXPECT_FALSE(fs::exists(distortionFile(model_))) << "found out again";
}

TEST_F(FindingDistortion, LeavesNoModelWhenStoppedAndGoesOnWithWhatItHasFound) {
  EXPECT_TRUE(trainUntil(1));
  EXPECT_FALSE(ModelFolder(model_).manifest());
  EXPECT_FALSE(file().contains("chosen"));
  const nlohmann::json known = told();
  ASSERT_LT(known.size(), kProbes);
  // As if the first had been far better than any can be.
  nlohmann::json better = file();
  better["probes"][0]["psnr"] = 99;
  writeFileAtomically(distortionFile(model_), better.dump());
  options_.loop.resume = true;
  EXPECT_TRUE(train().finished);
  EXPECT_EQ(told().size(), kProbes);
  EXPECT_EQ(told()[0]["psnr"], 99);
  EXPECT_EQ(saved(), known[0]["distortion"].get<double>());
}

TEST_F(FindingDistortion, BelievesNoFileOfOtherSettingsOrOfSomebodyElse) {
  // That the first probe is made again.
  const auto expectAnew = [&](const nlohmann::json& json) {
    writeFileAtomically(distortionFile(model_), json.dump());
    options_.loop.resume = true;
    const auto isMade = [&] {
      const nlohmann::json probes = told();
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
  expectAnew(changed("/made_with/rate", "0.5"));
  expectAnew(changed("/made_with/blocks", {2, 1}));
  expectAnew(changed("/made_with/photos/0", "another.png"));
  expectAnew(nlohmann::json::array());
}

TEST_F(FindingDistortion, IsForgottenByATrainingThatBeginsAnew) {
  EXPECT_TRUE(trainUntil(1));
  options_.config.distortion = 0.05;
  train();
  EXPECT_FALSE(fs::exists(distortionFile(model_)));
  EXPECT_EQ(savedConfig<HashConfig>(model_).distortion, 0.05);
  // And a weight that was given by hand is gone on with.
  options_.config.distortion.reset();
  options_.loop.resume = true;
  options_.loop.steps = 50;
  EXPECT_EQ(train().step, 50);
  EXPECT_EQ(savedConfig<HashConfig>(model_).distortion, 0.05);
  // Somebody has written into config.toml.
  writeFileAtomically(model_ / "config.toml", configToToml(options_.config.fields()));
  EXPECT_THROW(train(), Error);
}

TEST_F(FindingDistortion, IsPartOfTheTime) {
  options_.loop.steps = 0;
  options_.loop.minutes = 0.1;
  TrainingLoopOptions loop = options_.loop;
  fs::create_directories(model_);
  const BlockGrid grid = cubeGrid();
  const auto start = std::chrono::steady_clock::now();
  ASSERT_TRUE(findDistortion({*device_, scene_.capture(), grid}, model_, options_.config, loop, [] {}));
  const std::chrono::duration<double, std::ratio<60>> spent = std::chrono::steady_clock::now() - start;
  EXPECT_GE(loop.minutes, std::max(0.01, 0.1 - spent.count()) - 1e-9);
  EXPECT_LT(loop.minutes, 0.1 - 0.01) << "the first probe alone has taken as much";
}

}  // namespace
}  // namespace tessera
