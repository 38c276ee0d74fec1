// `tessera train --method hash`: a capture to a model folder.
#pragma once

#include "representations/hash/train/hash_trainer.h"
#include "train/block_run.h"

namespace tessera {

struct TrainHashOptions : BlockRunOptions {
  HashConfig config;
};

// Cuts the capture into blocks, or takes those that are given (blocks.json, blocks.svg, blocks.geojson), warns of those
// that will not come out well, trains, resumes, saves; see training_loop.h. Writes config.toml and blocks.json first.
// Before that, where the weight of the distortion loss is to be found out, short trainings of a few weights, which
// distortion.json tells of, and which `loop.resume` does not make again; they count as part of `loop.minutes`. A run
// that goes on has found it out. Asked to stop meanwhile, there is no model yet.
// Then coarser levels of detail of the same blocks, up to one whose tiles hold all; where the finest has been trained
// on since, they are made anew. The result counts the finest level's steps; it is finished when all levels are.
TrainingResult trainHash(Device& device, const Capture& capture, const fs::path& model, TrainHashOptions options);

// The settings of a level, from those of the finest: half the lattice, one fine level fewer, and tables of a quarter of
// the entries for each, as far as there is anything left to take away.
HashConfig levelConfig(HashConfig finest, uint32_t level, int64_t finestStep);

// What training keeps of one block.
double trainingBytesPerBlock(const HashConfig& config);

}  // namespace tessera
