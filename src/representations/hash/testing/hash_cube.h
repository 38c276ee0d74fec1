// For tests: a `hash` model that is trained on the cube scene, divided into blocks.
#pragma once

#include "representations/hash/train/hash_trainer.h"
#include "train/testing/cube_scene.h"

namespace tessera {

// A model that is small enough to train within seconds and large enough to learn the cube.
inline HashConfig smallHashConfig() {
  HashConfig config;
  config.backgroundBlock = "none";
  config.lattice = 16;
  config.coarseLevels = 3;
  config.coarseLog2Size = 12;
  config.coarseBase = 4;
  config.width = 16;
  config.fineLevels = 2;
  config.fineLog2Size = 13;
  config.directionWidth = 16;
  config.maxRayStep = 0.5;
  config.occupancyResolution = 32;
  config.samplesPerStep = 1 << 13;
  config.texelsPerStep = 1 << 14;
  config.maxRays = 2048;
  config.occupancyWarmupSteps = 32;
  config.learningRate = 2e-2;
  config.lossWarmupFraction = 0;
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
