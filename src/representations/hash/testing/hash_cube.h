// For tests: the cube cut into blocks, and a `hash` model that has learned it.
#pragma once

#include "representations/hash/train/hash_trainer.h"
#include "train/testing/cube_scene.h"

namespace tessera {

// Small enough for seconds, large enough to learn the cube.
inline HashConfig smallHashConfig() {
  HashConfig config;
  config.surround = "none";
  config.lattice = 16;
  config.coarseLevels = 3;
  config.coarseLog2Size = 12;
  config.coarseBase = 4;
  config.width = 16;
  config.levels = 2;
  config.fineLog2Size = 13;
  config.directionWidth = 16;
  config.step = 0.5;
  config.occupancyResolution = 32;
  config.samplesPerStep = 1 << 13;
  config.texelsPerStep = 1 << 14;
  config.mostRays = 2048;
  config.occupancyWarmUp = 32;
  config.rate = 2e-2;
  config.rampShare = 0;
  config.fullGradientDistance = 0;
  config.exposure = false;
  return config;
}

struct TrainedHashCube {
  std::unique_ptr<Device> device;
  std::unique_ptr<HashTrainer> trainer;
  StepReport last;

  TrainedHashCube(const CubeScene& scene, const HashConfig& config, const BlockGrid& grid, int64_t steps,
                  int threads = 2)
      : device(makeDevice({"cpu", threads})),
        trainer(std::make_unique<HashTrainer>(*device, scene.capture(), config, grid)) {
    for (int64_t step = 0; step < steps; ++step) last = trainer->step(step, steps);
  }
  HashModel& model() { return trainer->model(); }
  std::vector<Bytes> saved() {
    std::vector<Bytes> parts;
    for (uint32_t part = 0; part < trainer->parts(); ++part) parts.push_back(trainer->save(part));
    return parts;
  }
};

}  // namespace tessera
