// `tessera train --method field`: trains a capture into a model folder.
#pragma once

#include "representations/field/train/field_trainer.h"

namespace tessera {

struct TrainFieldOptions {
  FieldConfig config;
  TrainingLoopOptions loop;
};

// Trains or resumes the model and saves it; see training_loop.h. Writes config.toml and blocks.json first. Throws Error
// if the folder holds a capture, or a model that was trained on other photos, and as FieldTrainer and runTraining do.
TrainingResult trainField(Device& device, const Capture& capture, const fs::path& model, TrainFieldOptions options);

}  // namespace tessera
