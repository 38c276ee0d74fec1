// One training step of the `hash` representation: rays → samples → features → image → losses → gradients → Adam.
#pragma once

#include "representations/hash/train/hash_pipeline.h"
#include "train/photo_loss.h"
#include "train/ray_budget.h"
#include "train/training_loop.h"

namespace tessera {

class HashTrainer final : public TrainableModel {
 public:
  // Keeps references to `device` and `capture`. Trains on the capture's training photos. `config.distortionWeight` must
  // have a number (distortion_choice.h). Throws Error if no training photo sees the scene.
  HashTrainer(Device& device, const Capture& capture, const HashConfig& config, const BlockGrid& grid);

  StepReport step(int64_t step, int64_t plannedSteps) override;
  // There is one part for each block; part 0 includes the state that all blocks share.
  uint32_t parts() const override { return model_.space().blocks(); }
  Bytes save(uint32_t part) override;
  void restore(uint32_t part, const fs::path& path, const Safetensors& state) override;
  std::optional<uint32_t> firstNonFinitePart() override;

  HashModel& model() { return model_; }

  // Of a coarser level: takes the exposures of the level below, and does not train them (PhotoExposures::hold).
  void holdExposures(const ModelFolder& below) { photoLoss_.exposures().hold(below); }
  // Restricts the following rays to these shares of photos, [photos]: for training, or for evaluate().
  void trainOn(std::vector<TileShares> photos);
  void evaluateOn(std::vector<TileShares> photos);
  // The error of the rays of a step over colour channels; evaluating does not train.
  struct Evaluation {
    double squaredError = 0;  // sum over channels
    double channels = 0;      // number of colour channels of unmasked rays
    double loss = 0;
  };
  Evaluation evaluate(int64_t step);

 private:
  void refreshOccupancy(int64_t step);
  HashModel::Rays drawRays(int64_t step);
  bool drawsFewerRays(uint32_t texelsDemanded);
  PhotoLoss::Picture makeLossPicture(const HashModel::Rays& rays) const;
  Evaluation makeEvaluation(uint32_t rays, const std::vector<float>& losses) const;
  void addGradients(const HashModel::Rays& rays, int64_t step, int64_t plannedSteps);
  void updateParameters(int64_t step, int64_t plannedSteps);

  Device& device_;
  HashConfig config_;
  HashModel model_;
  HashPipeline pipeline_;
  PhotoRays photoRays_;
  PhotoLoss photoLoss_;
  RayBudget budget_;
  Array<float> losses_;  // [PhotoLoss::kLosses]
};

// Returns the weight of the distortion loss at `step`: it rises from 0 to the config's weight over the first
// lossWarmupFraction of the planned steps. `plannedSteps` is 0 while it is unknown.
double distortionWeight(const HashConfig& config, int64_t step, int64_t plannedSteps);

}  // namespace tessera
