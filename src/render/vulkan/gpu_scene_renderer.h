// Draws scenes on a GPU, of any representation that has a drawer there, with the cache and the levels of detail of the
// renderer on the CPU (render/cpu/scene_renderer.h), which its pictures are held against.
#pragma once

#include "render/scene_tiles.h"
#include "render/tile_prefetch.h"
#include "render/tile_scene.h"
#include "render/vulkan/gpu_drawer.h"

namespace tessera {

struct GpuRendererSettings {
  DrawSettings draw;  // render() is always exact; draw() as `exact` says
  SelectionSettings selection;
  uint64_t budgetBytes = uint64_t{1} << 30;  // of the card's memory, for contents
  // Contents are read by threads of their own, and a picture is of what is there; else each picture waits for all that
  // it asks for.
  bool inBackground = false;
};

// What of a scene is drawn, and what is held for it.
struct SceneState {
  size_t drawn = 0;    // contents in the last picture
  size_t missing = 0;  // contents that it asked for and did not have
  size_t refused = 0;  // that the budget has no room for
  TileCacheStatistics cache;
  uint64_t budgetBytes = 0;
};

// A scene of any representation on a graphics card.
class GpuViewRenderer : public ViewRenderer {
 public:
  // As render(), but the picture stays on the card, and nothing waits for it: it is there for what is sent to the
  // context's queue afterwards, until the next one begins.
  virtual DrawnOnCard draw(const Camera& camera, const Pose& worldFromCamera) = 0;
  // Whether the same view would show more now: something has been read that the last picture had to do without, or the
  // drawer wants another frame.
  virtual bool hasMore() const = 0;
  struct Pixel {
    float opacity = 0, depth = 0;  // as of RenderedView
  };
  virtual Pixel pixelAt(int x, int y) = 0;  // of the last picture; waits
  virtual SceneState state() const = 0;
};

class GpuSceneRenderer final : public GpuViewRenderer {
 public:
  // The drawer draws by `stream`. Throws Error where the coarsest level does not fit into the budget or the card, and
  // in render() what the source throws.
  GpuSceneRenderer(std::shared_ptr<GpuStream> stream, std::unique_ptr<GpuDrawer> drawer, TileScene scene,
                   const GpuRendererSettings& settings);
  ~GpuSceneRenderer() override { stream_->context()->waitIdle(); }

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  DrawnOnCard draw(const Camera& camera, const Pose& worldFromCamera) override;
  bool hasMore() const override;
  std::string device() const override { return "vulkan " + stream_->context()->name(); }
  Eigen::Array3f background() const override { return background_; }
  Pixel pixelAt(int x, int y) override {
    const auto [opacity, depth] = picture_.opacityAndDepthAt(x, y);
    return {opacity, depth};
  }
  SceneState state() const override;

  const TileCut& cut() const { return tiles_.cut(); }  // of the last picture
  const TileChoice& choice() const { return tiles_.choice(); }
  const TileCache<GpuContent>& cache() const { return tiles_.cache(); }

 private:
  void queue(const PictureRequest& request, bool exact);
  TileSource<GpuContent> uploaded(const TileSource<Content>& source);

  std::shared_ptr<GpuStream> stream_;
  std::unique_ptr<GpuDrawer> drawer_;
  std::unique_ptr<TilePrefetch<std::unique_ptr<Content>>> prefetch_;  // null: everything is waited for
  SceneTiles<GpuContent> tiles_;
  GpuRendererSettings settings_;
  Eigen::Array3f background_;
  GpuPicture picture_;
};

}  // namespace tessera
