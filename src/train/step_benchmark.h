// Measures the speed of a method's training step on fixed samples, without photos, ray marching or occupancy updates.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tessera {

struct StepBenchmarkOptions {
  uint32_t rays = 2048;
  uint32_t samplesPerRay = 32;
  double seconds = 5;  // time to repeat the step for, at least 3 times, after two untimed warm-up steps
};

struct StepBenchmark {
  uint32_t samples = 0;  // per step
  int steps = 0;         // number of timed steps
  double medianSeconds = 0, bestSeconds = 0;
  double samplesPerSecond = 0;  // of the median step
  double firstLoss = 0, lastLoss = 0;
  struct Phase {
    std::string name;  // as forward, composite, backward, adam
    double medianSeconds = 0;
  };
  std::vector<Phase> phases;  // in the order in which they run; waiting between them counts only towards the step
};

}  // namespace tessera
