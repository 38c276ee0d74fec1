// `tessera train --method volume`: trains a model folder from a capture.
#pragma once

#include "representations/volume/train/volume_trainer.h"
#include "train/block_run.h"

namespace tessera {

struct TrainVolumeOptions : BlockRunOptions {
  VolumeConfig config;
};

// Partitions the capture into blocks, or takes the given ones, and writes config.toml and the blocks (blocks.json,
// blocks.svg, blocks.geojson) first. Warns of blocks that will not come out well, then trains, resumes and saves (see
// training_loop.h).
//
// Afterwards it trains the coarser levels of detail (City-on-Web, section 4.4), up to one that merges all blocks. Each
// level starts with the fields of the level below, first trains only new deferred networks for its merged blocks, then
// everything together through virtual grids of half the resolution. Levels are trained again from the start if the
// finest level has been trained further since. The result counts the steps of the finest level; it is finished when all
// levels are. Throws Error if a resumed run has other blocks than the given ones.
TrainingResult trainVolume(Device& device, const Capture& capture, const fs::path& model, TrainVolumeOptions options);

// Returns the settings of a level, from those of the finest: half the resolution per level, and its own fraction of
// uniform samples. The fields have the same shape on all levels.
VolumeConfig levelConfig(VolumeConfig finest, uint32_t level, int64_t finestStep);
// Loads a trained model for rendering from its folder, with all blocks in memory (0) or at most `residentBlocks` at a
// time (VolumeModel::ensureResident). Throws Error if its files are missing or malformed. Keeps a reference to
// `device`.
std::unique_ptr<VolumeModel> loadVolumeModel(Device& device, const fs::path& folder, uint32_t residentBlocks = 0);

// Returns the bytes that a block takes while it is trained: parameters, moments, gradients.
double trainingBytesPerBlock(const VolumeConfig& config);

// Returns how training divides a capture.
BlockDemand volumeBlockDemand(const VolumeConfig& config, const BlockRunOptions& options);

}  // namespace tessera
