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

constexpr int64_t kJudgedBatches = 64;  // of rays, at most
constexpr const char* kRemedy = "give a number: --set distortion=0.01";

// One short training, and how far it is from what was left out.
class Probing {
 public:
  Probing(HashTrainer& trainer, const DistortionProbing& options, const std::string& title)
      : trainer_(trainer), options_(options) {
    if (options.progress) progress_.emplace(title, 0, "steps");
  }

  // For `steps`, which a time settles where they are 0; `untilSettled`: and no longer. False when asked to stop.
  bool train(int64_t& steps, bool untilSettled) {
    using Clock = std::chrono::steady_clock;
    StepBudget budget(options_.minutes);
    const Clock::time_point start = Clock::now();
    for (int64_t step = 0; isFinite_ && (steps == 0 || step < steps); ++step) {
      if (options_.stopRequested()) return false;
      isFinite_ = std::isfinite(trainer_.step(step, steps).loss);
      if (steps == 0) {
        const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
        if (const int64_t fitting = budget.observe(step + 1, seconds)) steps = std::max(fitting, options_.fewestSteps);
        if (untilSettled && steps > 0) break;
      }
      if (!progress_) continue;
      progress_->setTotal(steps);
      progress_->update(step + 1);
    }
    return true;
  }

  // Nothing in `psnr` where training came to no numbers. False when asked to stop. Where a budget leaves few photos in
  // memory at a time, batches are so far apart that each photo comes up in some: in `stepsOfAllPhotos`.
  bool judge(int64_t steps, int64_t stepsOfAllPhotos, std::optional<double>& psnr) {
    if (!isFinite_) return true;
    HashTrainer::Fit all;
    const int64_t batches = std::min(kJudgedBatches, steps), apart = (stepsOfAllPhotos + batches - 1) / batches;
    for (int64_t batch = 0; batch < batches; ++batch) {
      if (options_.stopRequested()) return false;
      const HashTrainer::Fit fit = trainer_.fit(steps + apart * batch);
      all.squaredError += fit.squaredError;
      all.channels += fit.channels;
    }
    psnr = psnrOf(all);
    return true;
  }

 private:
  HashTrainer& trainer_;
  const DistortionProbing& options_;
  std::optional<Progress> progress_;
  bool isFinite_ = true;
};

}  // namespace

std::optional<double> psnrOf(const HashTrainer::Fit& fit) {
  if (fit.channels == 0) {
    throw Error("--set distortion=auto", "",
                "no pixel was found in the photos that were left out to judge by: they are masked, or too few photos "
                "are in memory at a time",
                kRemedy);
  }
  if (!std::isfinite(fit.squaredError)) return std::nullopt;
  return -10 * std::log10(std::max(1e-10, fit.squaredError / fit.channels));
}

double DistortionChoice::weight() const {
  CHECK(!probes.empty());
  std::optional<double> best, chosen;
  for (const Probe& probe : probes) best = std::max(best, probe.psnr);  // nothing is less than any number
  if (!best) {
    throw Error("--set distortion=auto", "", "with no weight did a short training come to numbers",
                "lower the learning rate: --set rate=...; or " + std::string(kRemedy));
  }
  for (const Probe& probe : probes) {
    if (probe.psnr && *probe.psnr >= *best - kAsGood) chosen = std::max(chosen, std::optional<double>(probe.weight));
  }
  return *chosen;
}

std::optional<DistortionChoice> chooseDistortion(Device& device, const Capture& capture, const HashConfig& config,
                                                 const BlockGrid& grid, const DistortionProbing& probing) {
  if (capture.photosIn(Split::train).size() < 2) {
    throw Error("--set distortion=auto", "", "there is one photo to train on, of which none can be left out", kRemedy);
  }
  const HeldOutPhotos photos = holdOutPhotos(capture, probing.heldOutOf, static_cast<uint64_t>(config.seed));
  const int64_t stepsOfAllPhotos = static_cast<int64_t>(capture.photosIn(Split::train).size()) * config.stepsPerPhoto;
  DistortionChoice choice = probing.known;
  if (choice.steps == 0 && probing.minutes <= 0) choice.steps = probing.steps;
  while (choice.probes.size() < probing.weights.size()) {
    const double weight = probing.weights[choice.probes.size()];
    HashConfig probed = config;
    probed.distortion = weight;
    HashTrainer trainer(device, capture, probed, grid);
    if (choice.probes.size() == probing.known.probes.size()) probing.begun();
    trainer.trainOn(photos.trained);
    Probing probe(trainer, probing, fmt::format("distortion {}", weight));
    // Where its weight rises with the share of the steps that are done, the first one would be trained otherwise.
    const bool asTimer = choice.steps == 0 && config.rampShare > 0;
    if (!probe.train(choice.steps, asTimer)) return std::nullopt;
    if (asTimer && choice.steps > 0) continue;
    trainer.judgeBy(photos.heldOut);
    DistortionChoice::Probe judged{weight, {}};
    if (!probe.judge(choice.steps, stepsOfAllPhotos, judged.psnr)) return std::nullopt;
    choice.probes.push_back(judged);
    inform("distortion {}: {} on photos left out, after {} steps", weight,
           judged.psnr ? fmt::format("{:.2f} dB", *judged.psnr) : "no numbers", choice.steps);
    probing.probed(choice);
  }
  return choice;
}

}  // namespace tessera
