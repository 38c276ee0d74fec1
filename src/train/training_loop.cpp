#include "train/training_loop.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/log.h"
#include "base/memory.h"
#include "base/progress.h"
#include "train/schedule.h"

namespace tessera {
namespace {

double computePsnr(double squaredError) {
  return -10 * std::log10(std::max(squaredError, 1e-10));
}

// Sums since the last line of metrics, from which the means are computed.
struct Window {
  int64_t steps = 0;
  double loss = 0, squaredError = 0, rays = 0, samples = 0, marched = 0, texels = 0, since = 0;

  void add(const StepReport& report) {
    ++steps;
    loss += report.loss;
    squaredError += report.squaredError;
    rays += report.rays;
    samples += report.samples;
    marched += report.marched;
    texels += report.texels;
  }
};

nlohmann::json metricsLine(int64_t step, double seconds, const Window& window) {
  const double span = std::max(1e-9, seconds - window.since);
  return {{"step", step},
          {"seconds", seconds},
          {"loss", window.loss / window.steps},
          {"psnr", computePsnr(window.squaredError / window.steps)},
          {"rays_per_second", window.rays / span},
          {"samples_per_second", window.samples / span},
          {"marched_per_second", window.marched / span},
          {"texels_per_second", window.texels / span},
          {"steps_per_second", window.steps / span},
          {"peak_rss_bytes", peakResidentBytes()}};
}

// The state from which training continues.
struct Start {
  ModelManifest state;
  int64_t planMadeAt = 0;  // see StepPlan
};

Start startingPoint(TrainableModel& trainable, const ModelFolder& folder, const TrainingLoopOptions& options) {
  ModelManifest state;
  state.method = options.method;
  refuseTrainedModel(folder, options);
  const std::optional<ModelManifest> manifest = folder.manifest();
  if (manifest) {
    if (manifest->method != options.method) {
      throw Error(folder.root().string(), "manifest.json", "was trained with --method " + manifest->method,
                  "resume with that method");
    }
    if (manifest->files.size() != trainable.parts()) {
      throw Error(
          folder.root().string(), "manifest.json",
          fmt::format("names {} checkpoints where the model has {} parts", manifest->files.size(), trainable.parts()),
          "restore the file or train again");
    }
    for (uint32_t part = 0; part < trainable.parts(); ++part) {
      const fs::path file = folder.root() / manifest->files[part];
      trainable.restore(part, file, readSafetensors(file));
    }
    state = *manifest;
    folder.cutMetrics(state.step);
  } else {
    folder.cutMetrics(-1);
  }
  if (options.steps > 0 && options.minutes <= 0) {
    if (state.step > options.steps) {
      throw Error(folder.root().string(), "manifest.json",
                  fmt::format("the model has been trained for {} steps, more than {}", state.step, options.steps),
                  "resume with as many --steps or more, or without --steps");
    }
    state.plannedSteps = options.steps;
    return {state, 0};
  }
  const StepPlan plan = options.resume ? folder.readPlan().value_or(StepPlan()) : StepPlan();
  if (options.minutes > 0) state.minutes = options.minutes;
  if (options.minutes > 0 || plan.steps > 0) {
    state.plannedSteps = plan.steps;
    return {state, plan.plannedAtStep};
  }
  if (state.plannedSteps == 0 && state.minutes > 0) return {state, 0};  // interrupted before it was known
  if (state.plannedSteps == 0) state.plannedSteps = kDefaultSteps;
  return {state, 0};
}

// Returns the time to the next checkpoint if the last one took `saving` seconds.
double secondsUntilCheckpoint(double saving) {
  constexpr double kUsual = 60, kLongest = 150, kShare = 0.05;
  return std::clamp(saving / kShare, kUsual, kLongest);
}

}  // namespace

void refuseTrainedModel(const ModelFolder& folder, const TrainingLoopOptions& options) {
  if (options.resume) return;
  const std::optional<ModelManifest> manifest = folder.manifest();
  if (!manifest) return;
  throw Error(folder.root().string(), "", fmt::format("already holds a model, trained for {} steps", manifest->step),
              "pass --resume to go on with it, or name another folder");
}

void requireFormat(const fs::path& path, const Safetensors& state, const std::string& format,
                   const std::string& method) {
  const auto entry = state.metadata.find("format");
  if (entry != state.metadata.end() && entry->second == format) return;
  throw Error(path.string(), "", "is not a checkpoint of --method " + method, "train again");
}

void warnOfOtherDevice(const fs::path& path, const Safetensors& state, const std::string& target) {
  const auto device = state.metadata.find("device");
  if (device == state.metadata.end() || device->second == target) return;
  warn("{} was trained on {}; going on with {} gives as good a model, but not the same bits", path.string(),
       device->second, target);
}

TrainingResult runTraining(TrainableModel& trainable, const ModelFolder& folder, const TrainingLoopOptions& options) {
  using Clock = std::chrono::steady_clock;
  auto [state, planMadeAt] = startingPoint(trainable, folder, options);
  const bool hasSteps = options.steps > 0 && options.minutes <= 0;
  if (!options.resume || hasSteps) fs::remove(folder.root() / "plan.json");
  const auto start = Clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(Clock::now() - start).count(); };
  StepBudget budget(state.minutes);
  Window window;
  TrainingResult result;
  double savedAt = 0, lastSaving = 0, saving = 0;  // seconds
  double totalSamples = 0, totalRays = 0;
  // Of the minutes, what an earlier process has taken that was interrupted before the number of steps was known.
  const double secondsBefore = state.plannedSteps == 0 ? state.seconds : 0;
  const double savingBefore = state.plannedSteps == 0 ? state.savingSeconds : 0;
  std::optional<Progress> progress;
  if (options.progress) progress.emplace("training", state.plannedSteps, "steps");

  const auto notANumber = [&](const std::string& what) {
    const std::optional<uint32_t> part = trainable.firstNonFinitePart();
    return Error(folder.root().string(),
                 part ? fmt::format("step {}, block {}", state.step, *part) : fmt::format("step {}", state.step),
                 what + " is not a number",
                 "train into another folder with a lower --set learning_rate=..., and report it with the capture");
  };
  const auto save = [&] {
    const double begun = seconds();
    if (trainable.firstNonFinitePart()) throw notANumber("a parameter");
    state.seconds = secondsBefore + begun;
    state.savingSeconds = savingBefore + saving;
    folder.commit(state, trainable.parts(), [&](uint32_t part) {
      return trainable.isAsSaved(part) ? std::nullopt : std::optional<Bytes>(trainable.save(part));
    });
    options.saved();
    savedAt = seconds();
    lastSaving = savedAt - begun;
    saving += lastSaving;
  };
  const auto untilSaving = [&] { return options.checkpointSeconds.value_or(secondsUntilCheckpoint(lastSaving)); };
  const auto unfinished = [&] { return state.plannedSteps == 0 || state.step < state.plannedSteps; };
  while (unfinished() && !options.stopRequested()) {
    const StepReport report = trainable.step(state.step, state.step < planMadeAt ? 0 : state.plannedSteps);
    if (!std::isfinite(report.loss)) throw notANumber("the loss");
    window.add(report);
    totalSamples += report.samples;
    totalRays += report.rays;
    ++state.step;
    const double now = seconds();
    if (state.plannedSteps == 0) {
      // A step at least lies between two checkpoints.
      const double perStep = (secondsBefore + now - savingBefore - saving) / static_cast<double>(state.step);
      const double savingShare = lastSaving > 0 ? lastSaving / (lastSaving + std::max(untilSaving(), perStep)) : 0;
      state.plannedSteps = budget.observe(state.step, secondsBefore + now, savingBefore + saving, savingShare);
      if (state.plannedSteps != 0) {
        planMadeAt = state.step;
        folder.writePlan({state.plannedSteps, planMadeAt});
        if (progress) progress->setTotal(state.plannedSteps);
      }
    }
    result.psnr = computePsnr(window.squaredError / window.steps);
    if (progress) progress->update(state.step, fmt::format("{:.2f} dB", *result.psnr));
    if (now - window.since >= 2 || !unfinished()) {
      folder.appendMetrics(metricsLine(state.step, now, window));
      window = Window();
      window.since = now;
    }
    if (unfinished() && now - savedAt >= untilSaving()) save();
  }
  save();
  result.step = state.step;
  result.plannedSteps = state.plannedSteps;
  result.finished = !unfinished();
  result.seconds = seconds();
  result.samplesPerSecond = totalSamples / std::max(1e-9, result.seconds);
  result.samplesPerRay = totalSamples / std::max(1.0, totalRays);
  if (progress) progress->finish(result.psnr ? fmt::format("{:.2f} dB", *result.psnr) : "");
  return result;
}

}  // namespace tessera
