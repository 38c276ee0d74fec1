// One training step of the `hash` representation: rays → samples → features → picture → losses → gradients → Adam.
#pragma once

#include "representations/hash/train/hash_pass.h"
#include "train/photo_loss.h"
#include "train/ray_budget.h"
#include "train/training_loop.h"

namespace tessera {

class HashTrainer final : public Trainee {
 public:
  // Keeps references to `device` and `capture`. Trains on the capture's training photos.
  // `config.distortion` must be known (distortion_choice.h).
  HashTrainer(Device& device, const Capture& capture, const HashConfig& config, const BlockGrid& grid);

  StepReport step(int64_t step, int64_t plannedSteps) override;
  // One part a block; what all share stands with block 0.
  uint32_t parts() const override { return model_.space().blocks(); }
  Bytes save(uint32_t part) override;
  void restore(uint32_t part, const fs::path& path, const Safetensors& state) override;
  std::optional<uint32_t> brokenPart() override;

  HashModel& model() { return model_; }

  // Takes rays from these alone from now on ([photo]), to learn from them, or to be judged by them (fit).
  void trainOn(std::vector<TileShares> photos);
  void judgeBy(std::vector<TileShares> photos);
  // How far the rays of a step are off, over colour channels, without being learned from.
  struct Fit {
    double squaredError = 0;  // sum
    double channels = 0;      // of rays that no mask leaves out
    double loss = 0;
  };
  Fit fit(int64_t step);

 private:
  void refreshOccupancy(int64_t step);
  HashModel::Rays drawRays(int64_t step);
  bool drawsFewerRays(uint32_t texelsWanted);
  PhotoLoss::Picture pictureOf(const HashModel::Rays& rays) const;
  Fit fitOf(uint32_t rays, const std::vector<float>& losses) const;
  void addGradients(const HashModel::Rays& rays, int64_t step, int64_t plannedSteps);
  void updateParameters(int64_t step, int64_t plannedSteps);

  Device& device_;
  HashConfig config_;
  HashModel model_;
  HashPass pass_;
  PhotoRays photoRays_;
  PhotoLoss photoLoss_;
  RayBudget budget_;
  Array<float> losses_;  // of colours
};

// The weight of the distortion loss, `step` into training: from 0 it rises to the config's (section 5 of the
// specification's schedules).
double distortionWeight(const HashConfig& config, int64_t step, int64_t plannedSteps);

}  // namespace tessera
