// One training step of the `volume` representation: rays → blocks → picture → losses → gradients → Adam.
#pragma once

#include "representations/volume/volume_pass.h"
#include "train/photo_exposures.h"
#include "train/photo_rays.h"
#include "train/training_loop.h"

namespace tessera {

class VolumeTrainer final : public Trainee {
 public:
  // Keeps references to `device` and `capture`. Trains on the capture's training photos.
  VolumeTrainer(Device& device, const Capture& capture, const VolumeConfig& config, const BlockGrid& grid);

  StepReport step(int64_t step, int64_t plannedSteps) override;
  // One part a block; exposures and the like stand with block 0.
  uint32_t parts() const override { return model_.space().blocks(); }
  Bytes save(uint32_t part) override;
  void restore(uint32_t part, const fs::path& path, const Safetensors& state) override;

  uint32_t brokenPart() override;

  VolumeModel& model() { return model_; }

 private:
  VolumePass::LossScales lossScales(double progress) const;
  void addColourGradients(int64_t step);
  // A coarser level's first steps: only deferred networks are trained, through the grid of the level below.
  bool isFrozen(double progress) const { return config_.level > 0 && progress < config_.frozenShare; }
  void updateParameters(int64_t step, int64_t plannedSteps, const VolumePass::Options& kept);

  Device& device_;
  VolumeConfig config_;
  VolumeModel model_;
  VolumePass pass_;
  PhotoRays photoRays_;
  PhotoExposures exposures_;
  uint32_t rays_;  // of the next step
  Array<float> exposed_, colourGradients_, opacityGradients_, losses_;
};

// The opacity of a renderer's step below which samples are culled, `progress` in [0,1] into training.
float cullThreshold(const VolumeConfig& config, double progress);

}  // namespace tessera
