// For tests: settings of a mesh that is small enough to train within seconds.
#pragma once

#include "representations/mesh/train/config.h"

namespace tessera {

inline MeshConfig smallMeshConfig() {
  MeshConfig config;
  config.coarseSteps = 100;
  config.gridLevels = 6;
  config.gridLog2Size = 13;
  config.gridBase = 8;
  config.gridFinest = 96;
  config.width = 16;
  config.meshCells = config.backgroundCells = 16;
  config.meshLevels = 2;
  config.occupancyStartSteps = 64;
  config.occupancyEvery = 8;
  config.vertexStartSteps = 40;
  config.samplesPerStep = 16384;
  config.maxRays = 4096;
  config.learningRate = 2e-2;
  config.exposure = false;
  config.enoughPhotos = 0;
  config.patchTexels = 8;
  return config;
}

}  // namespace tessera
