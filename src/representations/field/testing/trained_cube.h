// For tests: a field that is trained on the cube scene.
#pragma once

#include "representations/field/train/train_field.h"
#include "train/testing/cube_scene.h"

namespace tessera {

// A model that is small enough to train within seconds and large enough to learn the cube.
inline FieldConfig cubeConfig() {
  FieldConfig config;
  config.gridLevels = 6;
  config.gridLog2Size = 13;
  config.gridBase = 8;
  config.gridFinest = 96;
  config.width = 16;
  config.densityHidden = 1;
  config.colourHidden = 1;
  config.occupancyResolution = 32;
  config.occupancyWarmupSteps = 64;
  config.occupancyEvery = 4;
  config.near = 0.4;  // nothing is nearer to any camera
  config.far = 4;
  config.minStep = 0.05;
  config.cone = 0.1;
  config.samplesPerStep = 8192;
  config.firstRays = 512;
  config.maxRays = 4096;
  config.learningRate = 2e-2;
  config.exposure = false;
  return config;
}

struct TrainedCube {
  std::unique_ptr<Device> device;
  SceneFrame frame;
  std::unique_ptr<FieldTrainer> trainer;

  TrainedCube(const CubeScene& scene, const FieldConfig& config, int64_t steps, int threads = 2)
      : device(makeDevice({"cpu", threads})),
        frame(fitSceneFrame(scene.capture(), config.roiMargin)),
        trainer(std::make_unique<FieldTrainer>(*device, scene.capture(), config, frame)) {
    for (int64_t step = 0; step < steps; ++step) last = trainer->step(step, steps);
  }
  StepReport last;
};

}  // namespace tessera
