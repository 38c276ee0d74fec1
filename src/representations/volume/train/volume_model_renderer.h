// Renders a volume model along the samples that proposals choose, as in training but with more of them, with the
// networks evaluated at texels. Baked scenes are tested against its images.
#pragma once

#include "representations/volume/train/volume_pipeline.h"
#include "scene/view_renderer.h"
#include "train/image_rays.h"

namespace tessera {

class VolumeModelRenderer final : public ViewRenderer {
 public:
  // Culls samples whose opacity over a renderer's step is below `minAlpha`, as baking does. Keeps a reference to
  // `model`.
  VolumeModelRenderer(VolumeModel& model, float minAlpha);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override;
  bool showsOutside() const override { return model_.space().backgroundBlock != BackgroundBlockMode::none; }

 private:
  VolumeModel& model_;
  float minAlpha_;
  VolumePipeline pipeline_;
  ImageRays imageRays_;
};

}  // namespace tessera
