// How fast the arithmetic of a training step runs: the model of `field` on fixed samples, without photos, marching or
// occupancy, so that it can be put beside the same step in another framework (bench/libtorch_step.cpp).
#pragma once

#include "compute/device.h"
#include "train/step_benchmark.h"

namespace tessera {

// Hash grid, density network, harmonics, colour network, compositing, Huber, backward, Adam. The same numbers on every
// run. The default settings' shape, samples_per_pass, delta of the Huber loss and decay of the networks.
StepBenchmark benchmarkFieldStep(Device& device, const StepBenchmarkOptions& options);

}  // namespace tessera
