// What comes before the parts of a mesh are trained: a coarse field of the whole capture, and what it shows of the
// photos: what moves in them, and views between them.
#pragma once

#include "representations/mesh/train/config.h"
#include "scene/block_grid.h"
#include "scene/capture.h"
#include "train/model_folder.h"
#include "train/training_loop.h"

namespace tessera {

// Makes all of it in the folder of the mesh, unless it has been made, and returns the result of training the coarse
// field: without seconds and rates if it was complete before. `loop`: that of the whole training. Throws StageStopped
// if it is asked to stop, and Error as trainField does, if a photo or mask cannot be read, or if a file cannot be
// written.
TrainingResult trainCoarseStage(Device& device, const Capture& capture, const fs::path& mesh, const BlockGrid& grid,
                                const MeshConfig& config, const TrainingLoopOptions& loop);

// Returns what the parts are trained on: the photos without what moves, and the views between them. Throws Error if a
// list of files is malformed, or an image is missing.
Capture captureOfParts(const Capture& capture, const fs::path& mesh, const MeshConfig& config);

// Removes what this stage has made. removeModel removes a model with all that is in its folder; a folder without a
// model is left as it is.
void removeCoarseStage(const fs::path& mesh);
void removeModel(const ModelFolder& folder);

}  // namespace tessera
