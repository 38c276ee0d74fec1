// The final stage of the training of a part, which the paper lacks: from its first step on, the triangles are fixed,
// and what is trained is what contents store. It extracts the triangles of the finest level, fits the coarser levels to
// them, and trains the texels of all levels on the rays of each step.
#pragma once

#include <memory>

#include "representations/mesh/train/atlas_stage.h"
#include "train/photo_tiles.h"
#include "train/training_loop.h"

namespace tessera {

class FinalStage {
 public:
  // Rays are drawn as squares of neighbouring pixels: their hits share texels, at which the encoder is evaluated once.
  static constexpr uint32_t kSquareOfRays = 2;

  // Keeps references to `model` and `capture`. `tiles`: [photo], the parts of photos that the part is trained on;
  // pixelWidth: MeshStart::pixelWidth.
  FinalStage(MeshModel& model, const Capture& capture, std::vector<TileShares> tiles, double pixelWidth);

  bool hasBegun() const { return !levels_.empty(); }
  // Makes what the model lacks: the triangles, the ranges of their texels, and the coarser levels. Throws Error if a
  // mask cannot be read.
  void begin();
  // Removes all of this from the model, if it is there: the training goes on beyond its former end.
  void undo();

  // Adds the gradients of the finest level: of the networks, the table and the sky.
  void addGradients(const PhotoRays& rays, PhotoLoss& photoLoss);
  // Trains the texels of the coarser levels, level l with the first rays of the step >> (l - 1). `done`: share of the
  // final stage.
  void trainCoarserLevels(const PhotoRays& rays, PhotoLoss& photoLoss, double done);
  // What the last step did at the finest level. Waits for the device.
  StepReport report(const PhotoRays& rays);
  // Counts and reports the pixels of a block that its triangles do not cover; `when`, relative to this stage.
  void updateCoverage(const char* when);

 private:
  void extract();
  void fitCoarserLevel(uint32_t level);

  MeshModel& model_;
  Device& device_;
  const Capture& capture_;
  std::vector<TileShares> tiles_;
  double pixelWidth_;
  std::vector<std::unique_ptr<AtlasStage>> levels_;
  Array<float> losses_, coarserLosses_;  // [AtlasStage::kLosses]
  Array<uint32_t> counters_, coarserCounters_;
};

}  // namespace tessera
