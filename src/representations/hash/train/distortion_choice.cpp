#include "representations/hash/train/distortion_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/check.h"
#include "base/error.h"
#include "base/log.h"
#include "base/progress.h"
#include "train/held_out_photos.h"
#include "train/schedule.h"

namespace tessera {
namespace {

constexpr int64_t kMaxEvaluationBatches = 64;  // of rays
constexpr const char* kRemedy = "give a number: --set distortion_weight=0.01";

// Runs one short training and evaluates it on the photos that were left out.
class ProbeRun {
 public:
  ProbeRun(HashTrainer& trainer, const DistortionSearch& options, const std::string& title)
      : trainer_(trainer), options_(options) {
    if (options.progress) progress_.emplace(title, 0, "steps");
  }

  // Trains for `steps`. If these are 0, they are determined from the time that steps take; with `untilKnown`, training
  // then ends as soon as they are known. Returns false if it was asked to stop.
  bool train(int64_t& steps, bool untilKnown) {
    using Clock = std::chrono::steady_clock;
    StepBudget budget(options_.minutes);
    const Clock::time_point start = Clock::now();
    for (int64_t step = 0; isFinite_ && (steps == 0 || step < steps); ++step) {
      if (options_.stopRequested()) return false;
      isFinite_ = std::isfinite(trainer_.step(step, steps).loss);
      if (steps == 0) {
        const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
        if (const int64_t fitting = budget.observe(step + 1, seconds)) steps = std::max(fitting, options_.minSteps);
        if (untilKnown && steps > 0) break;
      }
      if (!progress_) continue;
      progress_->setTotal(steps);
      progress_->update(step + 1);
    }
    return true;
  }

  // Computes the PSNR on the photos that were left out; it stays empty if the training diverged. Returns false if it
  // was asked to stop. If the photo budget leaves few photos in memory at a time, the batches are spaced over
  // `stepsOfAllPhotos` steps, in which each photo is in memory at some time.
  bool evaluate(int64_t steps, int64_t stepsOfAllPhotos, std::optional<double>& psnr) {
    if (!isFinite_) return true;
    HashTrainer::Evaluation all;
    const int64_t batches = std::min(kMaxEvaluationBatches, steps), apart = (stepsOfAllPhotos + batches - 1) / batches;
    for (int64_t batch = 0; batch < batches; ++batch) {
      if (options_.stopRequested()) return false;
      const HashTrainer::Evaluation evaluation = trainer_.evaluate(steps + apart * batch);
      all.squaredError += evaluation.squaredError;
      all.channels += evaluation.channels;
    }
    psnr = computePsnr(all);
    return true;
  }

 private:
  HashTrainer& trainer_;
  const DistortionSearch& options_;
  std::optional<Progress> progress_;
  bool isFinite_ = true;
};

}  // namespace

std::optional<double> computePsnr(const HashTrainer::Evaluation& evaluate) {
  if (evaluate.channels == 0) {
    throw Error(
        "--set distortion_weight=auto", "",
        "the photos that were left out for evaluation have no usable pixels: they are masked, or too few photos "
        "are in memory at a time",
        kRemedy);
  }
  if (!std::isfinite(evaluate.squaredError)) return std::nullopt;
  return -10 * std::log10(std::max(1e-10, evaluate.squaredError / evaluate.channels));
}

double DistortionChoice::weight() const {
  CHECK(!probes.empty());
  std::optional<double> best, chosen;
  for (const Probe& probe : probes) best = std::max(best, probe.psnr);  // nullopt is less than any number
  if (!best) {
    throw Error("--set distortion_weight=auto", "", "the short trainings diverged with every weight",
                "lower the learning rate: --set learning_rate=...; or " + std::string(kRemedy));
  }
  for (const Probe& probe : probes) {
    if (probe.psnr && *probe.psnr >= *best - kAsGood) chosen = std::max(chosen, std::optional<double>(probe.weight));
  }
  return *chosen;
}

std::optional<DistortionChoice> chooseDistortion(Device& device, const Capture& capture, const HashConfig& config,
                                                 const BlockGrid& grid, const DistortionSearch& probing) {
  if (capture.photosIn(Split::train).size() < 2) {
    throw Error("--set distortion_weight=auto", "",
                "there are fewer than two training photos, so none can be left out for evaluation", kRemedy);
  }
  const HeldOutPhotos photos = holdOutPhotos(capture, probing.holdOutInterval, static_cast<uint64_t>(config.seed));
  const int64_t stepsOfAllPhotos = static_cast<int64_t>(capture.photosIn(Split::train).size()) * config.stepsPerPhoto;
  DistortionChoice choice = probing.known;
  if (choice.steps == 0 && probing.minutes <= 0) choice.steps = probing.steps;
  while (choice.probes.size() < probing.weights.size()) {
    const double weight = probing.weights[choice.probes.size()];
    HashConfig probed = config;
    probed.distortionWeight = weight;
    HashTrainer trainer(device, capture, probed, grid);
    if (choice.probes.size() == probing.known.probes.size()) probing.begun();
    trainer.trainOn(photos.trained);
    ProbeRun probe(trainer, probing, fmt::format("distortion {}", weight));
    // If the weight rises with the fraction of completed steps, the first probe, whose number of steps is not known
    // yet, would be trained differently from the others. It then only measures the time and is run again.
    const bool asTimer = choice.steps == 0 && config.lossWarmupFraction > 0;
    if (!probe.train(choice.steps, asTimer)) return std::nullopt;
    if (asTimer && choice.steps > 0) continue;
    trainer.evaluateOn(photos.heldOut);
    DistortionChoice::Probe evaluated{weight, {}};
    if (!probe.evaluate(choice.steps, stepsOfAllPhotos, evaluated.psnr)) return std::nullopt;
    choice.probes.push_back(evaluated);
    inform("distortion weight {}: {} on the photos that were left out, after {} steps", weight,
           evaluated.psnr ? fmt::format("{:.2f} dB", *evaluated.psnr) : "diverged", choice.steps);
    probing.probed(choice);
  }
  return choice;
}

}  // namespace tessera
