// `tessera train --method volume`: a capture to a model folder.
#pragma once

#include "representations/volume/train/volume_trainer.h"
#include "train/block_run.h"

namespace tessera {

struct TrainVolumeOptions : BlockRunOptions {
  VolumeConfig config;
};

// Cuts the capture into blocks, or takes those that are given (blocks.json, blocks.svg, blocks.geojson), warns of those
// that will not come out well, trains, resumes, saves; see training_loop.h. Writes config.toml and blocks.json first.
// Then the coarser levels of detail (City-on-Web, section 4.4), up to one that holds all: each begins with the fields
// of the one below, trains new deferred networks for what it merges, then all together through virtual grids of half
// the resolution; where the finest has been trained on since, they are made anew. The result counts the finest level's
// steps; it is finished when all levels are. Throws Error when a resumed run has other blocks than those that are
// given.
TrainingResult trainVolume(Device& device, const Capture& capture, const fs::path& model, TrainVolumeOptions options);

// The settings of a level, from those of the finest: half the resolution for each, and its own padding. Its fields are
// the same.
VolumeConfig levelConfig(VolumeConfig finest, uint32_t level, int64_t finestStep);
// A trained model for drawing, from its folder: with all blocks in memory, or so many at a time (VolumeModel::bring).
std::unique_ptr<VolumeModel> loadVolumeModel(Device& device, const fs::path& folder, uint32_t residentBlocks = 0);

// Bytes that a block takes while it is trained: parameters, moments, gradients.
double trainingBytesPerBlock(const VolumeConfig& config);

}  // namespace tessera
