// One training step of the `volume` representation: rays → blocks → picture → losses → gradients → Adam.
#pragma once

#include "representations/volume/train/volume_pass.h"
#include "representations/volume/train/waiting_blocks.h"
#include "train/photo_loss.h"
#include "train/ray_budget.h"
#include "train/residency.h"
#include "train/training_loop.h"

namespace tessera {

class VolumeTrainer final : public Trainee {
 public:
  // Keeps references to `device` and `capture`. Trains on the capture's training photos. Where only some of the blocks
  // are to be in memory (residentBlocks), the others wait in files in `waiting`, a folder that is gone afterwards.
  VolumeTrainer(Device& device, const Capture& capture, const VolumeConfig& config, const BlockGrid& grid,
                const fs::path& waiting = {});

  StepReport step(int64_t step, int64_t plannedSteps) override;
  // One part a block; exposures and the like stand with block 0.
  uint32_t parts() const override { return model_.space().blocks(); }
  Bytes save(uint32_t part) override;
  bool isAsSaved(uint32_t part) const override { return part > 0 && asSaved_[part]; }  // what all share stands with 0
  void restore(uint32_t part, const fs::path& path, const Safetensors& state) override;

  std::optional<uint32_t> brokenPart() override;

  // A coarser level begins with the fields of the level below, as trained in that folder, and its photos' exposures.
  void beginFrom(const fs::path& below);
  // Where not all blocks are in memory at once: which are at which step.
  const Residency* residency() const { return residency_ ? &*residency_ : nullptr; }

  VolumeModel& model() { return model_; }
  const PhotoRays& rays() const { return photoRays_; }  // of the last step

 private:
  void planStays(const fs::path& waiting);
  void drawFrom(std::vector<double> shareOfSet);
  void moveIn(size_t stay);
  void restoreBlock(uint32_t block, const fs::path& path, const Safetensors& state);
  VolumePass::Options passOptions(int64_t step, double progress) const;
  VolumePass::LossScales lossScales(int64_t step, int64_t plannedSteps) const;
  VolumeRays forward(int64_t step, const VolumePass::Options& options);
  PhotoLoss::Picture addColourGradients(int64_t step);
  // A coarser level's first steps: only deferred networks are trained, through the grid of the level below.
  bool isFrozen(double progress) const { return config_.level > 0 && progress < config_.frozenShare; }
  void updateParameters(int64_t step, int64_t plannedSteps, const VolumePass::Options& kept);

  Device& device_;
  VolumeConfig config_;
  VolumeModel model_;
  VolumePass pass_;
  PhotoRays photoRays_;
  PhotoLoss photoLoss_;
  TiledPhotos tiles_;  // where rays come from some of them alone
  size_t photoCount_ = 0;
  // Where not all blocks are in memory.
  std::optional<WaitingBlocks> waiting_;
  std::optional<Residency> residency_;
  std::optional<size_t> stay_;  // that the slots are filled for
  std::vector<bool> asSaved_;   // [blocks]
  RayBudget budget_;
  Array<float> losses_;  // of colours, S3IM
};

// The opacity of a renderer's step below which samples are culled, `progress` in [0,1] into training.
float cullThreshold(const VolumeConfig& config, double progress);

}  // namespace tessera
