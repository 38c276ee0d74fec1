// Renders a trained `hash` model by ray marching, as in training.
#pragma once

#include "representations/hash/train/hash_pipeline.h"
#include "scene/view_renderer.h"
#include "train/image_rays.h"

namespace tessera {

class HashModelRenderer final : public ViewRenderer {
 public:
  // Keeps a reference to `model`.
  explicit HashModelRenderer(HashModel& model);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override;
  bool showsOutside() const override { return model_.space().backgroundBlock != BackgroundBlockMode::none; }

 private:
  HashModel& model_;
  ImageBatch batch_;
  HashPipeline pipeline_;
  ImageRays imageRays_;
};

}  // namespace tessera
