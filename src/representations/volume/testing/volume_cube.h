// For tests: the cube scene cut into blocks, and a volume model trained on it.
#pragma once

#include "representations/volume/train/volume_trainer.h"
#include "train/testing/cube_scene.h"

namespace tessera {

// Returns settings with the sizes of a model that trains within seconds; all else as in `config`.
inline VolumeConfig shrunk(VolumeConfig config) {
  config.voxels = 32;
  config.planes = 64;
  config.gridLevels = 6;
  config.gridLog2Size = 13;
  config.gridBase = 8;
  config.gridFinest = 64;
  config.width = 16;
  config.proposalLevels = 4;
  config.proposalLog2Size = 10;
  config.proposalFinest = 32;
  config.firstIntervals = 24;
  config.secondIntervals = 16;
  config.samples = 12;
  config.texelsPerStep = 1 << 15;
  config.firstRays = 512;
  config.maxRays = 2048;
  config.sparsityPoints = 256;
  return config;
}

// Returns settings that train in seconds and still learn the cube.
inline VolumeConfig smallVolumeConfig() {
  VolumeConfig config = shrunk({});
  config.backgroundBlock = "none";
  config.learningRate = 2e-2;
  config.fullGradientDistance = 0;
  config.exposure = false;
  return config;
}

struct TrainedVolumeCube {
  std::unique_ptr<Device> device;
  std::unique_ptr<VolumeTrainer> trainer;
  StepReport last;

  TrainedVolumeCube(const CubeScene& scene, const VolumeConfig& config, const BlockGrid& grid, int64_t steps,
                    int threads = 2)
      : device(makeDevice({"cpu", threads})),
        trainer(std::make_unique<VolumeTrainer>(*device, scene.capture(), config, grid, scene / "waiting")) {
    for (int64_t step = 0; step < steps; ++step) last = trainer->step(step, steps);
  }
  VolumeModel& model() { return trainer->model(); }
  std::vector<Bytes> saved() {
    std::vector<Bytes> parts;
    for (uint32_t part = 0; part < trainer->parts(); ++part) parts.push_back(trainer->save(part));
    return parts;
  }
};

}  // namespace tessera
