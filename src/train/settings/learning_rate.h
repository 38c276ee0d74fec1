// Settings of the optimiser.
#pragma once

#include "base/setting.h"
#include "train/schedule.h"

namespace tessera {

struct LearningRateSettings {
  SETTING(double, rate, 1e-2, "rate", "learning rate", positive());
  SETTING(double, finalRateFactor, 0.03, "final_rate_factor", "learning rate at the end, relative", positive());
  SETTING(double, constantRateShare, 0.4, "constant_rate_share",
          "share of the steps before the learning rate begins to fall", share());
  SETTING(double, networkL2, 1e-6, "network_l2", "weight decay of the networks", atLeast(0));

  // With the schedule's own warm-up, falling exponentially.
  RateSchedule rateSchedule() const {
    RateSchedule schedule;
    schedule.rate = rate;
    schedule.finalFactor = finalRateFactor;
    schedule.constantFraction = constantRateShare;
    return schedule;
  }
};

struct TableDecaySettings {
  SETTING(double, tableL2, 0, "table_l2", "weight decay of the hash tables' entries that a step touches", atLeast(0));
};

}  // namespace tessera
