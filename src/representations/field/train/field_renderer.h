// Renders a trained field model by ray marching, as in training, in a single pass: the densities of marched samples and
// the colours of visible ones are evaluated once.
#pragma once

#include "representations/field/train/field_model.h"
#include "scene/capture.h"
#include "scene/view_renderer.h"
#include "train/image_rays.h"
#include "train/method.h"

namespace tessera {

class FieldRenderer final : public ViewRenderer {
 public:
  // Keeps a reference to `model`.
  explicit FieldRenderer(FieldModel& model);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override;

  // From now on, renders only those occupied cells that the training photos see through unmasked pixels (CullOptions).
  // Throws Error if a mask cannot be read.
  void cullUnseen(
      const Capture& capture, const CullOptions& options,
      const std::function<void(int64_t done, int64_t all)>& onPhoto = [](int64_t, int64_t) {});

  // The cells that rays march through, as OccupancyGrid::bits.
  Slice<const uint32_t> cells() const { return seenCells_.size() > 0 ? seenCells_.all() : model_.occupancy().bits(); }

  static constexpr float kMinTransmittance = 1e-3f;  // rays end below this transmittance
  // Return the numbers of samples whose densities, and whose colours, were evaluated so far, cullUnseen included.
  uint64_t densitiesEvaluated() const { return densities_; }
  uint64_t coloursEvaluated() const { return colours_; }

 private:
  class SeenCells;

  // Renders the rays of a piece into colour_, opacity_, depth_ and weights_, as far as their samples fit.
  RoundCounts renderPiece(const ImageRays::Piece& piece);

  FieldModel& model_;
  uint64_t densities_ = 0, colours_ = 0;
  ImageBatch batch_;
  ImageRays imageRays_;
  RaySamples seen_;
  Array<uint32_t> seenCells_;  // after cullUnseen: as OccupancyGrid::bits
  Array<uint32_t> counters_;
  Array<float> colour_, opacity_, depth_, weights_;
};

}  // namespace tessera
