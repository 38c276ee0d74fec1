// Draws scenes of `volume` and of `hash` on the processor: the oracle that every other renderer of them is held
// against.
//
// A picture is drawn from the cut that the view asks for, loaded as far as the budget goes before it is drawn.
#pragma once

#include "render/cpu/draw_scene.h"
#include "render/scene_tiles.h"

namespace tessera {

struct SceneRendererSettings {
  MarchSettings march;
  SelectionSettings selection;
  uint64_t budgetBytes = uint64_t{1} << 30;
  int threads = 0;  // 0: as many as the machine has
  Eigen::Array3f background = Eigen::Array3f::Zero();
};

// Content: VolumeContent or HashContent.
template <class Content>
class SceneRenderer final : public ViewRenderer {
 public:
  // Throws Error where the coarsest level does not fit into the budget, and in
  // render() what the source throws.
  SceneRenderer(const TileFrame& frame, TileTree tree, TileSource<Content> source,
                const SceneRendererSettings& settings);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  // Loads what the view asks for, as render() would.
  void prepare(const Camera& camera, const Pose& worldFromCamera);
  std::string device() const override;
  Eigen::Array3f background() const override { return settings_.background; }

  const TileCut& cut() const { return tiles_.cut(); }  // of the last picture
  const TileChoice& choice() const { return tiles_.choice(); }
  const TileCache<Content>& cache() const { return tiles_.cache(); }
  const TileCacheStatistics& cacheStatistics() const { return tiles_.cache().statistics(); }
  const MarchCounts& marchCounts() const { return counts_; }  // of all pictures

 private:
  SceneTiles<Content> tiles_;
  SceneRendererSettings settings_;
  ThreadPool pool_;
  PixelDirections directions_;
  MarchCounts counts_;
};

using VolumeRenderer = SceneRenderer<VolumeContent>;
using HashRenderer = SceneRenderer<HashContent>;

}  // namespace tessera
