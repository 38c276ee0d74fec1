// Measures the speed of the arithmetic of a training step: the model of `field` on fixed samples, without photos,
// marching or occupancy, so that it can be compared with the same step in another framework (bench/libtorch_step.cpp).
#pragma once

#include "compute/device.h"
#include "train/step_benchmark.h"

namespace tessera {

// Times hash grid, density network, harmonics, colour network, compositing, Huber loss, backward and Adam. Every run
// computes the same values. Uses the default settings' shape, samples_per_micro_batch, delta of the Huber loss and
// decay of the networks.
StepBenchmark benchmarkFieldStep(Device& device, const StepBenchmarkOptions& options);

}  // namespace tessera
