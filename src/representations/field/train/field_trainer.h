// One training step of the `field` representation: rays → samples → field → image → loss → gradients → Adam.
#pragma once

#include "representations/field/train/field_model.h"
#include "train/photo_loss.h"
#include "train/ray_budget.h"
#include "train/training_loop.h"

namespace tessera {

class FieldTrainer final : public TrainableModel {
 public:
  // Keeps references to `device` and `capture`. Trains on the capture's training photos. Throws Error if none of them
  // sees the scene.
  FieldTrainer(Device& device, const Capture& capture, const FieldConfig& config, const SceneFrame& frame);

  StepReport step(int64_t step, int64_t plannedSteps) override;
  Bytes save(uint32_t part) override;
  void restore(uint32_t part, const fs::path& path, const Safetensors& state) override;
  std::optional<uint32_t> firstNonFinitePart() override;

  FieldModel& model() { return model_; }

 private:
  void refreshOccupancy(int64_t step);
  // Processes one micro-batch, rays [firstRay, firstRay + rayCount) of the step, from marching to the gradients of all
  // parameters.
  void addGradients(uint32_t microBatch, uint32_t firstRay, uint32_t rayCount);
  void updateParameters(int64_t step, int64_t plannedSteps);

  Device& device_;
  FieldConfig config_;
  FieldModel model_;
  PhotoRays photoRays_;
  PhotoLoss photoLoss_;
  RayBudget budget_;
  uint32_t microBatches_;  // per step; they bound the memory for what is stored until backward
  RaySamples seen_;        // of one micro-batch
  Array<uint32_t> counters_;
  Array<float> colour_, opacity_, depth_, losses_;
  Array<float> sampleWeights_, weightGradients_, logDensityGradients_, sampleColourGradients_;
};

}  // namespace tessera
