// `tessera train --method hash`: trains a capture into a model folder.
#pragma once

#include "representations/hash/train/hash_trainer.h"
#include "train/block_run.h"

namespace tessera {

struct TrainHashOptions : BlockRunOptions {
  HashConfig config;
};

// Divides the capture into blocks, or uses the blocks that are given (blocks.json, blocks.svg, blocks.geojson), warns
// about blocks that will be reconstructed poorly, and trains, resumes and saves; see training_loop.h. Writes
// config.toml and blocks.json first. If the weight of the distortion loss is auto, it is determined before that by
// short trainings with a few weights. They are recorded in distortion.json, are not repeated with `loop.resume`, and
// count as part of `loop.minutes`. A resumed run already has the weight. If asked to stop during these trainings, the
// folder does not contain a model yet. Afterwards trains coarser levels of detail of the same blocks, up to a level
// with a single tile for all blocks; they are trained again from the start if the finest level has been trained further
// since. The result counts the finest level's steps, and is finished when all levels are. Throws Error as openBlockRun,
// HashTrainer and runTraining do.
TrainingResult trainHash(Device& device, const Capture& capture, const fs::path& model, TrainHashOptions options);

// Derives the settings of a level from those of the finest: each level has half the lattice, one fine level fewer and
// tables with a quarter of the entries of the one below, down to a minimum of each.
HashConfig levelConfig(HashConfig finest, uint32_t level, int64_t finestStep);

// Returns the bytes of memory that training takes for one block.
double trainingBytesPerBlock(const HashConfig& config);

// Returns how training divides a capture.
BlockDemand hashBlockDemand(const HashConfig& config, const BlockRunOptions& options);

}  // namespace tessera
