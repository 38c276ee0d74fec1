// Renders a trained field model by ray marching, as in training.
#pragma once

#include "representations/field/train/field_model.h"
#include "scene/view_renderer.h"
#include "train/picture_rays.h"

namespace tessera {

class FieldRenderer final : public ViewRenderer {
 public:
  // Keeps a reference to `model`.
  explicit FieldRenderer(FieldModel& model);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override;

  static constexpr float kMinTransmittance = 1e-3f;       // rays end below this transmittance
  uint64_t samplesEvaluated() const { return samples_; }  // in all images so far

 private:
  FieldModel& model_;
  uint64_t samples_ = 0;
  PictureRays pictureRays_;
  RaySamples seen_;
  Array<uint32_t> counters_;
  Array<float> colour_, opacity_, depth_, weights_;
};

}  // namespace tessera
