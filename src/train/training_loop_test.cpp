#include "train/training_loop.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/error.h"
#include "train/testing/test_support.h"

namespace tessera {
namespace {

// Its state is one number; every step changes it depending on the step and on all steps before.
class FakeTrainableModel : public TrainableModel {
 public:
  StepReport step(int64_t step, int64_t plannedSteps) override {
    if (dieAt == step) throw std::runtime_error("killed");
    if (pace.count() > 0) std::this_thread::sleep_for(pace);
    state = state * 6364136223846793005ull + static_cast<uint64_t>(step);
    steps.push_back(step);
    planned.push_back(plannedSteps);
    StepReport report;
    report.loss = step == nanAt ? std::numeric_limits<double>::quiet_NaN() : 0.5;
    report.squaredError = 0.01;
    report.rays = 10;
    report.samples = 100;
    report.marched = 200;
    return report;
  }
  Bytes save(uint32_t) override {
    ++saves;
    const std::vector<uint64_t> values = {state};
    return encodeSafetensors({{"state", {TensorType::i64, {1}, std::as_bytes(std::span(values))}}});
  }
  void restore(uint32_t, const fs::path& path, const Safetensors& file) override {
    state = file.require(path, "state", TensorType::i64).as<uint64_t>()[0];
    ++restores;
  }

  std::optional<uint32_t> firstNonFinitePart() override { return broken; }

  uint64_t state = 1;
  std::optional<uint32_t> broken;
  int saves = 0, restores = 0;
  std::vector<int64_t> steps, planned;
  int64_t nanAt = -1, dieAt = -1;
  std::chrono::microseconds pace{0};
};

TrainingLoopOptions options(int64_t steps, bool resume = false) {
  TrainingLoopOptions loop;
  loop.method = "fake";
  loop.steps = steps;
  loop.resume = resume;
  loop.progress = false;
  return loop;
}

Bytes checkpoint(const ModelFolder& folder) {
  return readFile(folder.root() / folder.manifest()->files.at(0));
}

std::vector<int64_t> metricSteps(const ModelFolder& folder) {
  std::ifstream in(folder.metricsPath());
  std::vector<int64_t> steps;
  for (std::string line; std::getline(in, line);) steps.push_back(nlohmann::json::parse(line).at("step"));
  return steps;
}

class TrainingLoop : public testing::Test {
 protected:
  TrainingLoop() {
    for (const char* name : {"model", "unbroken"}) fs::create_directories(temporary_ / name);
  }

  const TemporaryFolder temporary_;
  const ModelFolder folder_{temporary_ / "model"};
};

TEST_F(TrainingLoop, DoesEveryStepOnceAndSaves) {
  FakeTrainableModel trainable;
  const TrainingResult result = runTraining(trainable, folder_, options(7));
  EXPECT_EQ(trainable.steps, (std::vector<int64_t>{0, 1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(trainable.planned, std::vector<int64_t>(7, 7));
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.step, 7);
  EXPECT_EQ(result.plannedSteps, 7);
  EXPECT_NEAR(result.psnr.value(), 20, 1e-9);
  EXPECT_EQ(result.samplesPerRay, 10);
  const auto manifest = folder_.manifest();
  ASSERT_TRUE(manifest);
  EXPECT_EQ(manifest->step, 7);
  EXPECT_EQ(manifest->method, "fake");
}

TEST_F(TrainingLoop, WritesMetricsWithEverythingInThem) {
  FakeTrainableModel trainable;
  runTraining(trainable, folder_, options(7));
  std::ifstream in(folder_.metricsPath());
  std::string last, line;
  while (std::getline(in, line)) last = line;
  const auto metrics = nlohmann::json::parse(last);
  EXPECT_EQ(metrics.at("step"), 7);
  EXPECT_NEAR(metrics.at("psnr"), 20, 1e-9);
  EXPECT_NEAR(metrics.at("loss"), 0.5, 1e-9);
  EXPECT_NEAR(metrics.at("samples_per_second").get<double>() / metrics.at("rays_per_second").get<double>(), 10, 1e-6);
  EXPECT_GE(metrics.at("seconds"), 0);
  EXPECT_GT(metrics.at("peak_rss_bytes"), 1000000);
}

TEST_F(TrainingLoop, DoesNotTouchAModelUnlessResumed) {
  FakeTrainableModel first, second;
  runTraining(first, folder_, options(3));
  folder_.writePlan({99, 9});
  const Bytes before = checkpoint(folder_);
  const std::string metrics = readTextFile(folder_.metricsPath());
  try {
    runTraining(second, folder_, options(5));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.subject(), folder_.root().string());
    EXPECT_NE(error.remedy().find("--resume"), std::string::npos);
  }
  EXPECT_TRUE(second.steps.empty());
  EXPECT_EQ(checkpoint(folder_), before);
  EXPECT_EQ(readTextFile(folder_.metricsPath()), metrics);
  EXPECT_EQ(folder_.readPlan(), (StepPlan{99, 9}));
}

TEST_F(TrainingLoop, ResumesToTheSameEndAsAnUnbrokenRun) {
  FakeTrainableModel unbroken;
  const ModelFolder other(temporary_ / "unbroken");
  runTraining(unbroken, other, options(20));
  int64_t lastStep = -1;
  for (const int64_t stopAt : {1, 2, 9, 19, 20}) {
    FakeTrainableModel trainable;
    TrainingLoopOptions some = options(20, true);
    some.stopRequested = [&] { return !trainable.steps.empty() && trainable.steps.back() + 1 >= stopAt; };
    const TrainingResult result = runTraining(trainable, folder_, some);
    EXPECT_EQ(result.step, stopAt);
    EXPECT_EQ(result.finished, stopAt == 20);
    EXPECT_EQ(trainable.steps.front(), lastStep + 1);
    lastStep = trainable.steps.back();
  }
  EXPECT_EQ(checkpoint(folder_), checkpoint(other));
}

TEST_F(TrainingLoop, ResumesAfterBeingKilledFromTheLastCheckpoint) {
  FakeTrainableModel unbroken;
  const ModelFolder other(temporary_ / "unbroken");
  runTraining(unbroken, other, options(20));
  for (const int64_t dieAt : {3, 4, 12, -1}) {
    FakeTrainableModel trainable;
    trainable.dieAt = dieAt;
    TrainingLoopOptions some = options(20, true);
    some.checkpointSeconds = dieAt == 4 ? 1000 : 0;  // the run that is killed at step 4 writes no checkpoint
    try {
      runTraining(trainable, folder_, some);
    } catch (const std::runtime_error& killed) {
      EXPECT_STREQ(killed.what(), "killed");
    }
    if (dieAt == 12) {
      EXPECT_EQ(trainable.steps.front(), 3);
    }
  }
  EXPECT_EQ(checkpoint(folder_), checkpoint(other));
  EXPECT_EQ(metricSteps(folder_).back(), 20);
}

TEST_F(TrainingLoop, RemovesMetricsOfRepeatedSteps) {
  FakeTrainableModel first;
  runTraining(first, folder_, options(3));
  folder_.appendMetrics({{"step", 4}});
  folder_.appendMetrics({{"step", 5}});
  FakeTrainableModel second;
  runTraining(second, folder_, options(5, true));
  EXPECT_EQ(metricSteps(folder_), (std::vector<int64_t>{3, 5}));
}

TEST_F(TrainingLoop, RemovesMetricsOfARunWithoutCheckpoints) {
  folder_.commit({"fake", 1, 1, {}}, 1, [](uint32_t) { return Bytes(); });
  fs::remove(folder_.root() / "manifest.json");
  folder_.appendMetrics({{"step", 1}});
  FakeTrainableModel trainable;
  runTraining(trainable, folder_, options(2));
  EXPECT_EQ(metricSteps(folder_), std::vector<int64_t>{2});
}

TEST_F(TrainingLoop, DoesNothingWhenResumedAtItsEnd) {
  FakeTrainableModel first, second;
  runTraining(first, folder_, options(3));
  const TrainingResult result = runTraining(second, folder_, options(3, true));
  EXPECT_TRUE(result.finished);
  EXPECT_TRUE(second.steps.empty());
  EXPECT_EQ(folder_.manifest()->step, 3);
  EXPECT_EQ(second.state, first.state);
}

TEST_F(TrainingLoop, RefusesFewerStepsThanHaveBeenDone) {
  FakeTrainableModel first, second;
  runTraining(first, folder_, options(3));
  EXPECT_THROW(runTraining(second, folder_, options(2, true)), Error);
  EXPECT_TRUE(second.steps.empty());
  EXPECT_EQ(folder_.manifest()->plannedSteps, 3);
}

TEST_F(TrainingLoop, StartsAnewWhenThereIsNothingToResume) {
  FakeTrainableModel trainable;
  EXPECT_TRUE(runTraining(trainable, folder_, options(3, true)).finished);
  EXPECT_EQ(trainable.restores, 0);
}

TEST_F(TrainingLoop, RefusesToResumeAModelOfAnotherMethod) {
  FakeTrainableModel first, second;
  runTraining(first, folder_, options(3));
  TrainingLoopOptions other = options(5, true);
  other.method = "other";
  try {
    runTraining(second, folder_, other);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("fake"), std::string::npos) << error.what();
  }
  EXPECT_TRUE(second.steps.empty());
}

TEST_F(TrainingLoop, ReportsTheStepOfANonFiniteLossAndKeepsTheCheckpointBefore) {
  FakeTrainableModel first, second;
  runTraining(first, folder_, options(3));
  const Bytes before = checkpoint(folder_);
  second.nanAt = 5;
  second.broken = 0;
  try {
    runTraining(second, folder_, options(9, true));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(error.place().find("step 5"), std::string::npos) << error.what();
    EXPECT_NE(error.place().find("block 0"), std::string::npos) << error.what();
  }
  EXPECT_EQ(folder_.manifest()->step, 3);
  EXPECT_EQ(checkpoint(folder_), before);
}

TEST_F(TrainingLoop, KeepsTheCheckpointBeforeANonFiniteParameter) {
  FakeTrainableModel first, second;
  runTraining(first, folder_, options(3));
  const Bytes before = checkpoint(folder_);
  second.broken = 4;
  try {
    runTraining(second, folder_, options(5, true));
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_NE(error.place().find("step 5, block 4"), std::string::npos) << error.what();
  }
  EXPECT_EQ(checkpoint(folder_), before);
}

TEST_F(TrainingLoop, KeepsThePlannedStepsWhenResumedWithoutANumberOfSteps) {
  FakeTrainableModel first, second, third;
  TrainingLoopOptions some = options(20);
  some.stopRequested = [&] { return first.steps.size() >= 5; };
  runTraining(first, folder_, some);
  EXPECT_EQ(runTraining(second, folder_, options(0, true)).plannedSteps, 20);
  EXPECT_EQ(second.steps.size(), 15u);
  folder_.writePlan({30, 4});  // as if derived from --minutes
  EXPECT_EQ(runTraining(third, folder_, options(0, true)).plannedSteps, 30);
  EXPECT_EQ(third.steps.size(), 10u);
}

TEST_F(TrainingLoop, SavesWhenItIsAskedToStop) {
  FakeTrainableModel trainable;
  TrainingLoopOptions some = options(1000000);
  some.stopRequested = [&] { return trainable.steps.size() >= 5; };
  const TrainingResult result = runTraining(trainable, folder_, some);
  EXPECT_FALSE(result.finished);
  EXPECT_EQ(result.step, 5);
  EXPECT_EQ(result.plannedSteps, 1000000);
  EXPECT_EQ(folder_.manifest()->step, 5);
  EXPECT_EQ(trainable.saves, 1);
}

TEST_F(TrainingLoop, FixesTheStepsOfItsMinutesOnceAndRemembersThem) {
  FakeTrainableModel trainable;
  trainable.pace = std::chrono::microseconds(200);
  TrainingLoopOptions some = options(0);
  some.minutes = 0.4 / 60;
  const TrainingResult result = runTraining(trainable, folder_, some);
  EXPECT_TRUE(result.finished);
  EXPECT_GT(result.plannedSteps, 128);
  EXPECT_EQ(result.step, result.plannedSteps);
  EXPECT_LT(result.seconds, 4);
  EXPECT_EQ(folder_.readPlan()->steps, result.plannedSteps);
  // The number of steps is unknown at first, and constant from then on.
  EXPECT_EQ(trainable.planned.front(), 0);
  EXPECT_EQ(trainable.planned.back(), result.plannedSteps);
  for (const int64_t planned : trainable.planned) EXPECT_TRUE(planned == 0 || planned == result.plannedSteps);
}

TEST_F(TrainingLoop, KeepsTheStepsOfItsMinutesWhenResumed) {
  FakeTrainableModel first;
  first.pace = std::chrono::microseconds(200);
  TrainingLoopOptions some = options(0, true);
  some.minutes = 0.4 / 60;
  some.stopRequested = [&] { return !first.planned.empty() && first.planned.back() != 0; };
  const TrainingResult stopped = runTraining(first, folder_, some);
  ASSERT_FALSE(stopped.finished);
  FakeTrainableModel second;  // runs at another speed
  some.stopRequested = [] { return false; };
  const TrainingResult result = runTraining(second, folder_, some);
  EXPECT_EQ(result.plannedSteps, stopped.plannedSteps);
  EXPECT_EQ(second.steps.front(), stopped.step);
  EXPECT_EQ(second.steps.back() + 1, stopped.plannedSteps);
}

// On machines that are taken away again and again, before a quarter of the minutes is over.
TEST_F(TrainingLoop, CountsTheMinutesOfInterruptedAttempts) {
  using Clock = std::chrono::steady_clock;
  TrainingLoopOptions some = options(0, true);
  some.minutes = 1.0 / 60;
  TrainingResult result;
  int attempts = 0;
  double seconds = 0;
  while (!result.finished && attempts < 100) {
    FakeTrainableModel trainable;
    trainable.pace = std::chrono::microseconds(1000);
    const auto begun = Clock::now();
    some.stopRequested = [&] { return Clock::now() - begun > std::chrono::milliseconds(100); };
    result = runTraining(trainable, folder_, some);
    seconds += result.seconds;
    ++attempts;
    const ModelManifest manifest = folder_.manifest().value_or(ModelManifest());
    EXPECT_EQ(manifest.plannedSteps == 0, manifest.seconds > 0) << "a manifest of known steps has no times";
  }
  EXPECT_TRUE(result.finished);
  EXPECT_GT(attempts, 1);
  EXPECT_LT(seconds, 10);
  EXPECT_EQ(folder_.readPlan()->steps, result.step);
}

TEST_F(TrainingLoop, RemembersItsMinutesBeforeTheStepsAreKnown) {
  FakeTrainableModel first, second;
  first.pace = second.pace = std::chrono::microseconds(200);
  TrainingLoopOptions some = options(0);
  some.minutes = 0.4 / 60;
  some.stopRequested = [&] { return first.steps.size() >= 20; };
  EXPECT_EQ(runTraining(first, folder_, some).plannedSteps, 0);
  const TrainingResult result = runTraining(second, folder_, options(0, true));
  EXPECT_TRUE(result.finished);
  EXPECT_NE(result.plannedSteps, kDefaultSteps);
  EXPECT_LT(result.seconds, 4);
  EXPECT_EQ(folder_.readPlan()->steps, result.plannedSteps);
}

TEST_F(TrainingLoop, TakesStepsInsteadOfAnEarlierPlan) {
  FakeTrainableModel first, second;
  fs::create_directories(folder_.root());
  folder_.writePlan({7, 3});
  TrainingLoopOptions some = options(20, true);
  some.stopRequested = [&] { return first.steps.size() >= 10; };
  EXPECT_EQ(runTraining(first, folder_, some).plannedSteps, 20);
  EXPECT_EQ(runTraining(second, folder_, options(0, true)).plannedSteps, 20);
}

// A checkpoint after each step takes as long as the step.
TEST_F(TrainingLoop, CountsCheckpointsOfEachStep) {
  FakeTrainableModel trainable;
  trainable.pace = std::chrono::microseconds(2000);
  TrainingLoopOptions some = options(0);
  some.minutes = 1.0 / 60;
  some.checkpointSeconds = 0;
  const TrainingResult result = runTraining(trainable, folder_, some);
  EXPECT_TRUE(result.finished);
  EXPECT_GT(result.seconds, 0.6) << "of 1 s";
}

TEST_F(TrainingLoop, UsesThePlanOfARunThatWasKilledBeforeItsFirstCheckpoint) {
  FakeTrainableModel first;
  first.pace = std::chrono::microseconds(200);
  TrainingLoopOptions some = options(0);
  some.minutes = 0.4 / 60;
  FakeTrainableModel* running = &first;
  some.stopRequested = [&]() -> bool {
    if (!running->planned.empty() && running->planned.back() != 0) throw std::runtime_error("killed");
    return false;
  };
  EXPECT_THROW(runTraining(first, folder_, some), std::runtime_error);
  ASSERT_FALSE(folder_.manifest());
  const StepPlan plan = folder_.readPlan().value_or(StepPlan());
  ASSERT_GT(plan.steps, 0);
  ASSERT_GT(plan.plannedAtStep, 0);
  some.stopRequested = [] { return false; };
  some.resume = true;
  FakeTrainableModel second;
  EXPECT_EQ(runTraining(second, folder_, some).step, plan.steps);
  // The steps of the killed run are repeated as it performed them.
  for (size_t i = 0; i < second.steps.size(); ++i) {
    ASSERT_EQ(second.planned[i], second.steps[i] < plan.plannedAtStep ? 0 : plan.steps) << second.steps[i];
  }
}

TEST_F(TrainingLoop, MakesANewPlanWhenItBeginsAnew) {
  fs::create_directories(folder_.root());
  folder_.writePlan({7, 3});
  FakeTrainableModel trainable;
  TrainingLoopOptions some = options(0);
  some.minutes = 0.05 / 60;
  EXPECT_NE(runTraining(trainable, folder_, some).plannedSteps, 7);
}

}  // namespace
}  // namespace tessera
