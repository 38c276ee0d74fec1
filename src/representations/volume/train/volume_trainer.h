// One training step of the `volume` representation: rays → blocks → image → losses → gradients → Adam.
#pragma once

#include "representations/volume/train/block_swap_folder.h"
#include "representations/volume/train/volume_pipeline.h"
#include "train/photo_loss.h"
#include "train/ray_budget.h"
#include "train/residency.h"
#include "train/training_loop.h"

namespace tessera {

class VolumeTrainer final : public TrainableModel {
 public:
  // Trains on the training photos of the capture. Keeps references to `device` and `capture`. If only some of the
  // blocks are to be resident (residentBlocks), the others are swapped to files in `waiting`, a folder that is removed
  // afterwards.
  VolumeTrainer(Device& device, const Capture& capture, const VolumeConfig& config, const BlockGrid& grid,
                const fs::path& waiting = {});

  StepReport step(int64_t step, int64_t plannedSteps) override;
  // One checkpoint part per block; exposures and other shared state are stored with block 0.
  uint32_t parts() const override { return model_.space().blocks(); }
  Bytes save(uint32_t part) override;
  bool isAsSaved(uint32_t part) const override { return part > 0 && asSaved_[part]; }  // part 0 has shared state
  void restore(uint32_t part, const fs::path& path, const Safetensors& state) override;

  std::optional<uint32_t> firstNonFinitePart() override;

  // Initialises a coarser level with the fields of the level below, as trained in that folder.
  void beginFrom(const fs::path& below);
  // Of a coarser level: takes the exposures of the level below, and does not train them (PhotoExposures::hold).
  void holdExposures(const ModelFolder& below) { photoLoss_.exposures().hold(below); }
  // The schedule of resident blocks; null if all blocks are in memory.
  const Residency* residency() const { return residency_ ? &*residency_ : nullptr; }

  VolumeModel& model() { return model_; }
  const PhotoRays& rays() const { return photoRays_; }  // of the last step

 private:
  void planResidentSets(const fs::path& waiting);
  void drawFrom(std::vector<double> shareOfSet);
  void swapIn(size_t residentSet);
  void restoreBlock(uint32_t block, const fs::path& path, const Safetensors& state);
  VolumePipeline::Options passOptions(int64_t step, double progress) const;
  VolumePipeline::LossScales lossScales(int64_t step, int64_t plannedSteps) const;
  VolumeRays forward(int64_t step, const VolumePipeline::Options& options);
  PhotoLoss::Picture addColourGradients(int64_t step);
  // Returns whether a coarser level is in its first steps, which train only deferred networks, through the grid of the
  // level below.
  bool isFrozen(double progress) const { return config_.lod > 0 && progress < config_.deferredOnlyFraction; }
  void updateParameters(int64_t step, int64_t plannedSteps, const VolumePipeline::Options& options);

  Device& device_;
  VolumeConfig config_;
  VolumeModel model_;
  VolumePipeline pipeline_;
  PhotoRays photoRays_;
  PhotoLoss photoLoss_;
  TiledPhotos tiles_;  // set if rays are drawn from only some of them
  size_t photoCount_ = 0;
  // Set if not all blocks are in memory.
  std::optional<BlockSwapFolder> swap_;
  std::optional<Residency> residency_;
  std::optional<size_t> residentSet_;  // the resident set that is in the slots
  std::vector<bool> asSaved_;          // [blocks]
  RayBudget budget_;
  Array<float> losses_;  // PhotoLoss, then S3IM
};

// Returns the opacity of a renderer's step below which samples are culled; `progress` is the fraction of training that
// is done, in [0,1].
float cullThreshold(const VolumeConfig& config, double progress);

}  // namespace tessera
