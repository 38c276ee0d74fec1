// One training step of the `field` representation: rays → samples → field → picture → loss → gradients → Adam.
#pragma once

#include "representations/field/field_model.h"
#include "train/photo_window.h"
#include "train/ray_batch.h"
#include "train/training_loop.h"

namespace tessera {

class FieldTrainer final : public Trainee {
 public:
  // Keeps references to `device` and `capture`. Trains on the capture's training photos.
  FieldTrainer(Device& device, const Capture& capture, const FieldConfig& config, const SceneFrame& frame);

  StepReport step(int64_t step, int64_t plannedSteps) override;
  Bytes save() override;
  void restore(const fs::path& path, const Safetensors& state) override;

  FieldModel& model() { return model_; }

 private:
  void refreshOccupancy(int64_t step);
  void uploadRays();
  // One pass: rays [firstRay, firstRay + rayCount) of the step, from marching to the gradients of all parameters.
  void addGradients(uint32_t pass, uint32_t firstRay, uint32_t rayCount);
  void updateParameters(int64_t step, int64_t plannedSteps);
  void centreExposures();

  Device& device_;
  const Capture& capture_;
  FieldConfig config_;
  FieldModel model_;
  PhotoWindow photos_;
  std::vector<std::vector<KnownDistance>> known_;  // [photo]
  uint32_t rays_;                                  // of the next step
  uint32_t passes_;  // of a step: a part of the rays each, so that what is kept until backward fits memory
  RayBatch batch_;
  Array<RayCamera> cameras_;
  ParameterGroup exposures_;  // [photos][3], log2 gains
  RaySamples seen_;           // of one pass
  Array<uint32_t> photoOfRay_, counters_;
  Array<float> pixels_, targets_, backgrounds_, weights_, jitter_, distances_, origins_, directions_;
  Array<float> colour_, exposed_, opacity_, depth_, colourGradients_, opacityGradients_, losses_;
  Array<float> sampleWeights_, weightGradients_, logDensityGradients_, sampleColourGradients_;
};

}  // namespace tessera
