// How fast the arithmetic of a training step runs: the model of `field` on fixed samples, without photos, marching or
// occupancy, so that it can be put beside the same step in another framework (bench/libtorch_step.cpp).
#pragma once

#include <string>
#include <vector>

#include "compute/device.h"
#include "representations/field/config.h"

namespace tessera {

struct StepBenchmarkOptions {
  FieldConfig config;  // the model's shape, samples_per_pass, delta of the Huber loss, decay of the networks
  uint32_t rays = 2048;
  uint32_t samplesPerRay = 32;
  double seconds = 5;  // repeats for so long, after two steps that do not count, and at least 3 times
};

struct StepBenchmark {
  uint32_t samples = 0;  // of a step
  int steps = 0;         // timed
  double medianSeconds = 0, bestSeconds = 0;
  double samplesPerSecond = 0;  // of the median step
  double firstLoss = 0, lastLoss = 0;
  struct Phase {
    std::string name;  // forward, composite, backward, adam
    double medianSeconds = 0;
  };
  std::vector<Phase> phases;  // in the order they run; waits between them are part of the step
};

// Hash grid, density network, harmonics, colour network, compositing, Huber, backward, Adam. The same numbers on every
// run.
StepBenchmark benchmarkStep(Device& device, const StepBenchmarkOptions& options);

}  // namespace tessera
