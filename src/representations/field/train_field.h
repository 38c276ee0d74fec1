// `tessera train --method field`: a capture to a model folder.
#pragma once

#include "representations/field/field_trainer.h"

namespace tessera {

struct TrainFieldOptions {
  FieldConfig config;
  TrainingLoopOptions loop;
};

// Trains, resumes, saves; see training_loop.h. Writes config.toml and blocks.json first.
TrainingResult trainField(Device& device, const Capture& capture, const fs::path& model, TrainFieldOptions options);

// Where no photo budget is set and all training photos, decoded, would take more than half of `usableMemory` (bytes):
// sets it to that half and says so.
void settlePhotoBudget(FieldConfig& config, const Capture& capture, int64_t usableMemory);

// The settings of the run that `model` holds; the defaults when it holds none.
FieldConfig resumedFieldConfig(const fs::path& model);

// Throws Error when `model` holds a run of other settings: resumed, it would be repeatable from neither.
void requireSameConfig(const fs::path& model, FieldConfig config);

}  // namespace tessera
