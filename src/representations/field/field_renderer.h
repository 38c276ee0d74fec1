// Draws a field model by marching: the training-time picture.
#pragma once

#include "representations/field/field_model.h"
#include "scene/view_renderer.h"
#include "train/picture_rays.h"

namespace tessera {

class FieldRenderer final : public ViewRenderer {
 public:
  // Keeps a reference to `model`.
  explicit FieldRenderer(FieldModel& model);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override;

 private:
  FieldModel& model_;
  PictureRays pictureRays_;
  RaySamples seen_;
  Array<uint32_t> counters_;
  Array<float> colour_, opacity_, depth_, weights_;
};

}  // namespace tessera
