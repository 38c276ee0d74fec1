// Renders a trained mesh by tracing rays through the octahedra of its parts and compositing all hits, as in training.
#pragma once

#include "representations/mesh/train/mesh_model.h"
#include "representations/mesh/train/trained_mesh.h"
#include "scene/view_renderer.h"
#include "train/image_rays.h"

namespace tessera {

// Renders one level of detail of a part: of a block, what lies within its walls.
class MeshPartRenderer final : public ViewRenderer {
 public:
  // Keeps a reference to `model`.
  explicit MeshPartRenderer(MeshModel& model, uint32_t level = 0);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override { return model_.device().name(); }
  // The colours of the sky behind the last view, of all pixels; empty for a block.
  const ImageF& skyColours() const { return skyColours_; }

 private:
  // Renders the rays of a piece, as far as their hits fit; returns the numbers of hits and of these rays.
  std::vector<uint32_t> renderPiece(const ImageRays::Piece& piece);

  MeshModel& model_;
  uint32_t level_;
  ImageBatch batch_;
  ImageRays imageRays_;
  MeshHits hits_;
  Array<uint32_t> counters_;
  Array<float> colour_, opacity_, depth_, weights_, sky_;
  ImageF skyColours_;
};

// Renders the blocks, front to back, and what lies outside behind them.
class MeshRenderer final : public ViewRenderer {
 public:
  // Keeps a reference to `mesh`.
  explicit MeshRenderer(TrainedMesh& mesh);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override { return mesh_.device->name(); }
  bool showsOutside() const override;

 private:
  TrainedMesh& mesh_;
  std::vector<std::unique_ptr<MeshPartRenderer>> parts_;  // of mesh_.parts
};

}  // namespace tessera
