// Trains a mesh: a coarse field of the whole capture, which also shows what moves and what views between the photos
// show, then one part after another.
#pragma once

#include "representations/mesh/train/mesh_trainer.h"
#include "train/block_run.h"

namespace tessera {

struct TrainMeshOptions : BlockRunOptions {
  MeshConfig config;
};

// Trains or resumes the mesh in the folder `model` (trained_mesh.h). Every part has checkpoints of its own. `steps` of
// the loop counts the steps of a block. With BlockRunOptions::only, trains these parts alone, or with "coarse" only the
// coarse field, with the masks of what moves and the views between photos; several processes may train different parts
// of a mesh at a time once the coarse field is trained. Throws Error before it writes anything if a setting is invalid,
// before it trains anything if a part of that name does not exist, and as openBlockRun and runTraining do.
TrainingResult trainMesh(Device& device, const Capture& capture, const fs::path& model, TrainMeshOptions options);

// Returns how training divides a capture.
BlockDemand meshBlockDemand(const MeshConfig& config);

}  // namespace tessera
