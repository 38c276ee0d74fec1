// `tessera train --method volume`: a capture to a model folder.
#pragma once

#include "partition/partition.h"
#include "representations/volume/volume_trainer.h"

namespace tessera {

struct TrainVolumeOptions {
  VolumeConfig config;
  TrainingLoopOptions loop;
  BlockCount blocks;
};

// Cuts the capture into blocks (blocks.json, blocks.svg, blocks.geojson), warns of those that will not come out well,
// trains, resumes, saves; see training_loop.h. Writes config.toml and blocks.json first.
TrainingResult trainVolume(Device& device, const Capture& capture, const fs::path& model, TrainVolumeOptions options);

// The grid of blocks.json; Error when there is none.
BlockGrid requireGrid(const ModelFolder& folder);

// A trained model for drawing, from its folder.
std::unique_ptr<VolumeModel> loadVolumeModel(Device& device, const fs::path& folder);

// Bytes that a block takes while it is trained: parameters, moments, gradients.
double trainingBytesPerBlock(const VolumeConfig& config);

}  // namespace tessera
