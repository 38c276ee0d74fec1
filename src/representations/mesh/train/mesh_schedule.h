// The schedules of UE4-NeRF's losses (Gu et al. 2023, equations 5 and 7), scaled from the paper's 80,000 steps.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tessera {

struct MeshSchedule {
  static constexpr int64_t kPaperSteps = 80000, kPaperPeriod = 10000;

  // The number of whole periods before a step out of `steps`; 0 if their number is unknown.
  static int64_t period(int64_t step, int64_t steps) {
    return steps > 0 ? step * (kPaperSteps / kPaperPeriod) / steps : 0;
  }
  // β: the weight of the first loss; that of the second is 1 - β. The paper prints 0.8 · ⌊e / 10000⌋, which contradicts
  // its text; 0.8 to that power agrees with it.
  static double firstWeight(int64_t step, int64_t steps) {
    return std::pow(0.8, static_cast<double>(period(step, steps)));
  }
  // f: the opacity above which samples count in the second loss.
  static double threshold(int64_t step, int64_t steps) {
    const double periods = static_cast<double>(std::max<int64_t>(0, period(step, steps) - 1));
    return std::min(0.3, 0.012 * periods * periods);
  }
};

}  // namespace tessera
