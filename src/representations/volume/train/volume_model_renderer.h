// Draws a volume model: along the samples that proposals choose, as in training but more of them, with the networks
// evaluated at texels. The picture that baking is held against.
#pragma once

#include "representations/volume/train/volume_pass.h"
#include "scene/view_renderer.h"
#include "train/picture_rays.h"

namespace tessera {

class VolumeModelRenderer final : public ViewRenderer {
 public:
  // Samples whose renderer's step is less opaque than `minAlpha` are culled, as baking does. Keeps a reference to
  // `model`.
  VolumeModelRenderer(VolumeModel& model, float minAlpha);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override;

 private:
  VolumeModel& model_;
  float minAlpha_;
  VolumePass pass_;
  PictureRays pictureRays_;
};

}  // namespace tessera
