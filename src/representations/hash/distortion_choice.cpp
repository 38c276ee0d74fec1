#include "representations/hash/distortion_choice.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "base/check.h"
#include "base/log.h"
#include "train/held_out_tiles.h"
#include "train/schedule.h"

namespace tessera {
namespace {

constexpr int64_t kJudgedBatches = 64;  // of rays

// Trains for `plannedSteps`, or until `budget` says how many those are. False when asked to stop.
bool trainProbe(HashTrainer& trainer, int64_t& plannedSteps, StepBudget budget,
                const std::function<bool()>& stopRequested) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  for (int64_t step = 0; plannedSteps == 0 || step < plannedSteps; ++step) {
    if (stopRequested()) return false;
    trainer.step(step, plannedSteps);
    const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
    if (plannedSteps == 0) plannedSteps = budget.observe(step + 1, seconds);
  }
  return true;
}

double judgedPsnr(HashTrainer& trainer, int64_t firstStep) {
  HashTrainer::Fit all;
  for (int64_t batch = 0; batch < kJudgedBatches; ++batch) {
    const HashTrainer::Fit fit = trainer.fit(firstStep + batch);
    all.squaredError += fit.squaredError;
    all.channels += fit.channels;
  }
  return -10 * std::log10(std::max(1e-10, all.squaredError / std::max(1.0, all.channels)));
}

}  // namespace

double DistortionChoice::weight() const {
  CHECK(!probes.empty());
  return std::max_element(probes.begin(), probes.end(), [](const Probe& a, const Probe& b) { return a.psnr < b.psnr; })
      ->weight;
}

std::optional<DistortionChoice> chooseDistortion(Device& device, const Capture& capture, const HashConfig& config,
                                                 const BlockGrid& grid, const DistortionProbing& probing,
                                                 const std::function<bool()>& stopRequested) {
  const HeldOutTiles tiles = holdOutTiles(capture, probing.heldOutShare, static_cast<uint64_t>(config.seed));
  DistortionChoice choice;
  choice.steps = probing.minutes > 0 ? 0 : probing.steps;
  for (const double weight : probing.weights) {
    HashConfig probed = config;
    probed.distortion = weight;
    HashTrainer trainer(device, capture, probed, grid);
    trainer.drawFrom(tiles.trained);
    if (!trainProbe(trainer, choice.steps, StepBudget(probing.minutes), stopRequested)) return std::nullopt;
    trainer.drawFrom(tiles.heldOut);
    choice.probes.push_back({weight, judgedPsnr(trainer, choice.steps)});
    inform("distortion {}: {:.2f} dB on pixels left out, after {} steps", weight, choice.probes.back().psnr,
           choice.steps);
  }
  return choice;
}

}  // namespace tessera
