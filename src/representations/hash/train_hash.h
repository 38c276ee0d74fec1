// `tessera train --method hash`: a capture to a model folder.
#pragma once

#include "partition/cut_blocks.h"
#include "representations/hash/hash_trainer.h"

namespace tessera {

struct TrainHashOptions {
  HashConfig config;
  TrainingLoopOptions loop;
  BlockCount blocks;
  std::optional<BlockGrid> grid;  // of these blocks, whatever `blocks` says
  double memoryMiB = 0;           // to plan blocks and photos for; 0: what the machine has
};

// Cuts the capture into blocks, or takes those that are given (blocks.json, blocks.svg, blocks.geojson), warns of those
// that will not come out well, trains, resumes, saves; see training_loop.h. Writes config.toml and blocks.json first.
// Then coarser levels of detail of the same blocks, up to one whose tiles hold all; where the finest has been trained
// on since, they are made anew. The result counts the finest level's steps; it is finished when all levels are.
TrainingResult trainHash(Device& device, const Capture& capture, const fs::path& model, TrainHashOptions options);

// The settings of a level, from those of the finest: half the lattice, one fine level fewer, and tables of a quarter of
// the entries for each, as far as there is anything left to take away.
HashConfig levelConfig(HashConfig finest, uint32_t level, int64_t finestStep);

// What training keeps of one block.
double trainingBytesPerBlock(const HashConfig& config);

}  // namespace tessera
