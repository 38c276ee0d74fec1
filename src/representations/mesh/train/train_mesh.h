// `tessera train --method mesh`: trains a capture into a model folder.
#pragma once

#include "representations/mesh/train/mesh_trainer.h"

namespace tessera {

struct TrainMeshOptions {
  MeshConfig config;
  TrainingLoopOptions loop;
};

// Trains or resumes the coarse field, in the folder `coarse` of the model, then the mesh, and saves it; see
// training_loop.h. Throws Error if the folder holds a capture, or a model that was trained on other photos, and as
// findMeshStart and runTraining do.
TrainingResult trainMesh(Device& device, const Capture& capture, const fs::path& model, TrainMeshOptions options);

}  // namespace tessera
