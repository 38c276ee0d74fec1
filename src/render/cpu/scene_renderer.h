// Renders scenes on the CPU, for any representation that has a CpuDrawer.
//
// An image is drawn from the cut that the view requests; as much of the cut as fits into the budget is loaded before
// drawing.
#pragma once

#include "render/drawer.h"
#include "render/scene_tiles.h"

namespace tessera {

struct SceneRendererSettings {
  DrawSettings draw;
  SelectionSettings selection;
  uint64_t budgetBytes = uint64_t{1} << 30;
  int threads = 0;  // 0: as many as the machine has
  Eigen::Array3f background = Eigen::Array3f::Zero();
};

class SceneRenderer : public ViewRenderer {
 public:
  // `source` returns decoded contents, which the drawer then prepares. Throws Error if the coarsest level does not fit
  // into the budget; render() rethrows what the source throws. CHECKs that the drawer has the requested skipping mode.
  SceneRenderer(std::unique_ptr<CpuDrawer> drawer, const TileFrame& frame, TileTree tree, TileSource<Content> source,
                const SceneRendererSettings& settings);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  // Loads what the view requests, as render() does, without drawing.
  void prepare(const Camera& camera, const Pose& worldFromCamera);
  std::string device() const override;
  Eigen::Array3f background() const override { return settings_.background; }

  const TileCut& cut() const { return tiles_.cut(); }  // of the last rendered image
  const TileChoice& choice() const { return tiles_.choice(); }
  const TileCache<Content>& cache() const { return tiles_.cache(); }
  const TileCacheStatistics& cacheStatistics() const { return tiles_.cache().statistics(); }
  const DrawCounts& drawCounts() const { return counts_; }  // summed over all rendered images

 private:
  std::unique_ptr<CpuDrawer> drawer_;
  SceneTiles<Content> tiles_;
  SceneRendererSettings settings_;
  ThreadPool pool_;
  DrawCounts counts_;
};

}  // namespace tessera
