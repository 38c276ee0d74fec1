// Settings of the optimiser.
#pragma once

#include "base/setting.h"
#include "train/schedule.h"

namespace tessera {

struct LearningRateSettings {
  SETTING(double, learningRate, 1e-2, "learning_rate", "learning rate", positive());
  SETTING(double, finalLearningRateFactor, 0.03, "final_learning_rate_factor",
          "final learning rate, relative to learning_rate", positive());
  SETTING(double, constantLearningRateFraction, 0.4, "constant_learning_rate_fraction",
          "share of the steps before the learning rate begins to fall", share());
  SETTING(double, networkL2, 1e-6, "network_l2", "weight decay of the networks", atLeast(0));

  // Returns the exponential schedule with the default warm-up of RateSchedule.
  RateSchedule rateSchedule() const {
    RateSchedule schedule;
    schedule.rate = learningRate;
    schedule.finalFactor = finalLearningRateFactor;
    schedule.constantFraction = constantLearningRateFraction;
    return schedule;
  }
};

struct TableDecaySettings {
  SETTING(double, tableL2, 0, "table_l2", "weight decay of the hash tables' entries that a step touches", atLeast(0));
};

}  // namespace tessera
