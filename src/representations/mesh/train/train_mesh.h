// Trains a mesh: a coarse field of the whole capture, then one part after another.
#pragma once

#include "representations/mesh/train/mesh_trainer.h"
#include "train/block_run.h"

namespace tessera {

struct TrainMeshOptions : BlockRunOptions {
  MeshConfig config;
};

// Trains or resumes the mesh in the folder `model` (trained_mesh.h). Every part has checkpoints of its own. `steps` of
// the loop counts the steps of a block. Throws Error before it writes anything if a setting is invalid, and as
// openBlockRun and runTraining do.
TrainingResult trainMesh(Device& device, const Capture& capture, const fs::path& model, TrainMeshOptions options);

}  // namespace tessera
