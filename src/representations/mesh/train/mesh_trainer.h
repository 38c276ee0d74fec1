// One training step of a part of a mesh: rays → hits on octahedra → field → two images → losses → gradients → Adam.
#pragma once

#include "representations/mesh/train/final_stage.h"
#include "representations/mesh/train/mesh_model.h"
#include "representations/mesh/train/mesh_start.h"
#include "representations/mesh/train/through_rays.h"
#include "train/photo_loss.h"
#include "train/ray_budget.h"
#include "train/training_loop.h"

namespace tessera {

class MeshTrainer final : public TrainableModel {
 public:
  // Keeps references to `device` and `capture`. Trains on the capture's training photos.
  MeshTrainer(Device& device, const Capture& capture, const MeshConfig& config, const MeshPart& part, MeshStart start);
  // Compares with photos at the exposures that a checkpoint of the coarse field holds, which are the same for all parts
  // and are not trained further. It holds those of the first `photos` of the capture; the others have neutral
  // exposures. Throws Error if it holds another number.
  void useExposures(const fs::path& path, const Safetensors& coarse, size_t photos) {
    photoLoss_.exposures().restoreFirst(path, coarse, photos);
  }

  StepReport step(int64_t step, int64_t plannedSteps) override;
  Bytes save(uint32_t part) override;
  void restore(uint32_t part, const fs::path& path, const Safetensors& state) override;
  std::optional<uint32_t> firstNonFinitePart() override;

  MeshModel& model() { return model_; }

 private:
  bool movesVertices(int64_t step) const { return step >= config_.vertexStartSteps && config_.vertexLearningRate > 0; }
  uint32_t maxHits(int64_t step) const;
  bool isFinalStage(int64_t step, int64_t plannedSteps) const;
  StepReport finalStep(int64_t step, int64_t plannedSteps);
  void refreshOccupancy(int64_t step);
  // Adds the gradients of a level of detail: of the networks and the vertices for the finest, of the vertices alone for
  // the others, which use a part of the rays.
  void addGradients(uint32_t level, int64_t step, int64_t plannedSteps);
  // The hits of a level, in hits_, and what its losses need.
  struct Batch {
    uint32_t rays;  // the first ones of the step
    bool isFinest;
    double mean;  // factor of the weights of its losses
    MeshField::Output output;
    Slice<float> losses;
  };
  // The first loss, of all hits, sets the gradients of samples; the second, of opaque hits, adds to them. Outside, all
  // hits stand before the sky, and there is no second loss.
  void addVolumeLoss(const Batch& batch, double weight);
  void addOpaqueLoss(const Batch& batch, double weight, double threshold);
  // Draws rays through the block, and adds the gradients of their loss, of the opacities alone, to the encoder and the
  // table. Returns their number.
  uint32_t addThroughGradients(int64_t step);
  void updateNetworks(double rate);
  void updateVertices(int64_t step, int64_t steps);

  Device& device_;
  const Capture& capture_;
  MeshConfig config_;
  MeshModel model_;
  PhotoRays photoRays_;
  std::optional<ThroughRays> throughRays_;
  double throughShare_ = 0;  // relative to the other rays
  PhotoLoss photoLoss_;
  RayBudget budget_;
  MeshHits hits_;
  Array<uint32_t> counters_;
  Array<float> colour_, opacity_, opaqueColour_, opaqueOpacity_, skyColour_, losses_;
  Array<float> sampleWeights_, sampleSteps_, weightGradients_, logitGradients_, sampleColourGradients_,
      positionGradients_;
  Array<float> rayOpacityGradients_, zeros_;  // for rays through the block
  FinalStage finalStage_;
};

}  // namespace tessera
