// Draws scenes on the CPU, of any representation that has a drawer there.
//
// A picture is drawn from the cut that the view asks for, loaded as far as the budget goes before it is drawn.
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
  // `source` gives contents as they are decoded; the drawer prepares them. Throws Error where the coarsest level does
  // not fit into the budget, and in render() what the source throws. CHECKs that the drawer has the mode of skipping.
  SceneRenderer(std::unique_ptr<CpuDrawer> drawer, const TileFrame& frame, TileTree tree, TileSource<Content> source,
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
  const DrawCounts& drawCounts() const { return counts_; }  // of all pictures

 private:
  std::unique_ptr<CpuDrawer> drawer_;
  SceneTiles<Content> tiles_;
  SceneRendererSettings settings_;
  ThreadPool pool_;
  DrawCounts counts_;
};

}  // namespace tessera
