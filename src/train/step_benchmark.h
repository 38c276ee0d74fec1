// How fast the arithmetic of a method's training step runs, on fixed samples, without photos, marching or occupancy.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tessera {

struct StepBenchmarkOptions {
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
    std::string name;  // as forward, composite, backward, adam
    double medianSeconds = 0;
  };
  std::vector<Phase> phases;  // in the order they run; waits between them are part of the step
};

}  // namespace tessera
