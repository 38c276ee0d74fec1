// Renders scenes on the GPU, for any representation that has a GpuDrawer, with the same cache and level-of-detail
// selection as the renderer on the CPU (render/cpu/scene_renderer.h), against which its images are tested.
#pragma once

#include "render/scene_tiles.h"
#include "render/tile_prefetch.h"
#include "render/tile_scene.h"
#include "render/vulkan/gpu_drawer.h"

namespace tessera {

struct GpuRendererSettings {
  DrawSettings draw;  // render() is always exact; draw() follows `exact`
  SelectionSettings selection;
  uint64_t budgetBytes = uint64_t{1} << 30;  // GPU memory for contents
  uint64_t poolBytes = uint64_t{1} << 28;    // GPU memory for what the drawer makes besides them
  // If true, contents are read by background threads and each image shows what is resident; otherwise each image waits
  // for everything that it requests.
  bool inBackground = false;
};

// The number of contents that the last image drew, and the state of the cache.
struct SceneState {
  size_t drawn = 0;    // contents drawn in the last image
  size_t missing = 0;  // contents that it requested and that were not resident
  size_t refused = 0;  // contents that do not fit into the budget
  TileCacheStatistics cache;
  uint64_t budgetBytes = 0;
};

// Renders a scene of any representation on the GPU.
class GpuViewRenderer : public ViewRenderer {
 public:
  // Draws as render() does, but the image stays on the GPU and the call does not wait: the image is available to work
  // that is submitted to the context's queue afterwards, until the next image begins.
  virtual GpuRenderedView draw(const Camera& camera, const Pose& worldFromCamera) = 0;
  // Returns whether drawing the same view again would show more: a content has been read that the last image lacked, or
  // the drawer wants another frame.
  virtual bool hasMore() const = 0;
  struct Pixel {
    float opacity = 0, depth = 0;  // as in RenderedView
  };
  virtual Pixel pixelAt(int x, int y) = 0;  // of the last image; waits for the GPU
  virtual SceneState state() const = 0;
};

class GpuSceneRenderer final : public GpuViewRenderer {
 public:
  // The drawer must use `stream`. Throws Error if the coarsest level does not fit into the budget or into GPU memory;
  // render() rethrows what the source throws.
  GpuSceneRenderer(std::shared_ptr<GpuStream> stream, std::unique_ptr<GpuDrawer> drawer, TileScene scene,
                   const GpuRendererSettings& settings);
  ~GpuSceneRenderer() override { stream_->context()->waitIdle(); }

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  GpuRenderedView draw(const Camera& camera, const Pose& worldFromCamera) override;
  // Queues an image among the rest of a world, without submitting it. `exact`: as in DrawSettings.
  GpuRenderedView queueAmong(const Camera& camera, const Pose& worldFromCamera, GpuSurroundings surroundings,
                             bool exact);
  bool hasMore() const override;
  std::string device() const override { return "vulkan " + stream_->context()->name(); }
  Eigen::Array3f background() const override { return background_; }
  Pixel pixelAt(int x, int y) override {
    const auto [opacity, depth] = frame_.opacityAndDepthAt(x, y);
    return {opacity, depth};
  }
  SceneState state() const override;

  RenderedView lastImage() { return frame_.drawn(); }  // also of draw(); waits for the GPU
  const TileFrame& frame() const { return tiles_.frame(); }
  bool isFading() const { return tiles_.isFading(); }  // of the last image: contents fade into others
  const TileCut& cut() const { return tiles_.cut(); }  // of the last image
  const TileChoice& choice() const { return tiles_.choice(); }
  const TileCache<GpuContent>& cache() const { return tiles_.cache(); }

 private:
  void queue(const ViewRequest& request, bool exact);
  std::function<std::unique_ptr<Content>(int tile)> prepared(const TileSource<Content>& source) const;
  TileSource<GpuContent> uploaded(const TileSource<Content>& source);

  std::shared_ptr<GpuStream> stream_;
  std::unique_ptr<GpuDrawer> drawer_;
  std::unique_ptr<TilePrefetch<std::unique_ptr<Content>>> prefetch_;  // null: each image waits for its contents
  SceneTiles<GpuContent> tiles_;
  GpuRendererSettings settings_;
  Eigen::Array3f background_;
  GpuFrame frame_;
};

}  // namespace tessera
