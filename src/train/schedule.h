// Schedules of training: the learning rate, and the number of steps for a given time.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>

namespace tessera {

// A learning rate schedule: a linear warm-up, then a constant rate until `constantFraction` of the steps, then an
// exponential decay to `finalFactor` times the rate at the end. With `linear` (the schedule of NGP-RT) the rate rises
// linearly from 0 at step 0 to `rate` after the warm-up, then falls linearly to 0 at the end.
struct RateSchedule {
  double rate = 1e-2;
  double finalFactor = 0.03;
  double constantFraction = 0.4;
  int warmUpSteps = 20;
  bool linear = false;

  // Returns the rate of a step out of `steps`. If `steps` is 0 their number is unknown, and the rate does not fall.
  double at(int64_t step, int64_t steps) const {
    if (linear) {
      const auto now = static_cast<double>(step), all = static_cast<double>(steps);
      if (step < warmUpSteps) return rate * now / warmUpSteps;
      return steps > 0 ? rate * std::max(0.0, all - now) / std::max(1.0, all - warmUpSteps) : rate;
    }
    double value = rate * std::min(1.0, static_cast<double>(step + 1) / (warmUpSteps + 1));
    const double fraction = steps > 0 ? static_cast<double>(step) / static_cast<double>(steps) : 0.0;
    if (fraction > constantFraction)
      value *= std::pow(finalFactor, (fraction - constantFraction) / (1 - constantFraction));
    return value;
  }
};

// Derives the number of steps from `--minutes`, once, early in training: from the speed in the last fifth of the first
// `share` of the time, because the first steps, before empty space is known, are slower. Until then the learning rate
// does not depend on the number of steps.
class StepBudget {
 public:
  explicit StepBudget(double minutes, double share = 0.25) : seconds_(minutes * 60), share_(share) {}

  // `seconds`: the time since training began, after `step` steps, of which `saving` went into checkpoints;
  // `savingShare`: of the time that is left. Returns the number of steps once it can be determined, else 0.
  int64_t observe(int64_t step, double seconds, double saving = 0, double savingShare = 0) {
    if (seconds < 0.8 * share_ * seconds_) return 0;
    const double stepping = seconds - saving;
    if (measureStep_ < 0) {
      measureStep_ = step;
      measureStart_ = stepping;
    }
    if (seconds < share_ * seconds_ || step < measureStep_ + kMin) return 0;
    const double perStep = (stepping - measureStart_) / static_cast<double>(step - measureStep_);
    const double left = (seconds_ - seconds) * (1 - savingShare);
    return step + std::max<int64_t>(0, static_cast<int64_t>(left / perStep));
  }

 private:
  static constexpr int64_t kMin = 16;
  double seconds_, share_, measureStart_ = 0;
  int64_t measureStep_ = -1;
};

}  // namespace tessera
