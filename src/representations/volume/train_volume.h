// `tessera train --method volume`: a capture to a model folder.
#pragma once

#include "partition/cut_blocks.h"
#include "representations/volume/volume_trainer.h"

namespace tessera {

struct TrainVolumeOptions {
  VolumeConfig config;
  TrainingLoopOptions loop;
  BlockCount blocks;
  std::optional<BlockGrid> grid;  // of these blocks, whatever `blocks` says
  double memoryMiB = 0;           // to plan blocks and photos for; 0: what the machine has
};

// Cuts the capture into blocks, or takes those that are given (blocks.json, blocks.svg, blocks.geojson), warns of those
// that will not come out well, trains, resumes, saves; see training_loop.h. Writes config.toml and blocks.json first.
// Then the coarser levels of detail (City-on-Web, section 4.4), up to one that holds all: each begins with the fields
// of the one below, trains new deferred networks for what it merges, then all together through virtual grids of half
// the resolution; where the finest has been trained on since, they are made anew. The result counts the finest level's
// steps; it is finished when all levels are. Throws Error when a resumed run has other blocks than those that are
// given.
TrainingResult trainVolume(Device& device, const Capture& capture, const fs::path& model, TrainVolumeOptions options);

// The folder of a level's model: the model's own for the finest, MODEL/levels/<level> for those above.
fs::path levelFolder(const fs::path& model, uint32_t level);
// Levels that are trained to their end, without a gap: at least 1, the finest. Warns of one that was made before the
// finest came to where it is; it counts as not trained.
uint32_t trainedLevels(const fs::path& model);
// The settings of a level, from those of the finest: half the resolution for each, and its own padding. Its fields are
// the same.
VolumeConfig levelConfig(VolumeConfig finest, uint32_t level, int64_t finestStep);
// How long it is trained: level_share of the finest's steps for the first, then twice as many each, as the same rays
// ask for fewer texels; no more than the finest's, or level_share of them.
int64_t levelSteps(const VolumeConfig& finest, uint32_t level, int64_t finestSteps);

// A trained model for drawing, from its folder: with all blocks in memory, or so many at a time (VolumeModel::bring).
std::unique_ptr<VolumeModel> loadVolumeModel(Device& device, const fs::path& folder, uint32_t residentBlocks = 0);

// Bytes that a block takes while it is trained: parameters, moments, gradients.
double trainingBytesPerBlock(const VolumeConfig& config);

}  // namespace tessera
