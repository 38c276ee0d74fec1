// Renders a trained mesh model by tracing rays through its octahedra and compositing all hits, as in training.
#pragma once

#include "representations/mesh/train/mesh_model.h"
#include "scene/view_renderer.h"
#include "train/image_rays.h"

namespace tessera {

class MeshRenderer final : public ViewRenderer {
 public:
  // Renders one level of detail. Keeps a reference to `model`.
  explicit MeshRenderer(MeshModel& model, uint32_t level = 0);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override { return model_.device().name(); }

 private:
  // Renders the rays of a piece, as far as their hits fit; returns the numbers of hits and of these rays.
  std::vector<uint32_t> renderPiece(const ImageRays::Piece& piece);

  MeshModel& model_;
  uint32_t level_;
  ImageRays imageRays_;
  MeshHits hits_;
  Array<uint32_t> counters_;
  Array<float> colour_, opacity_, depth_, weights_;
};

}  // namespace tessera
