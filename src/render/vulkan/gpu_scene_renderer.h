// Draws scenes of `volume` and of `hash` on a graphics card, with the cache and the levels of detail of the renderer on
// the processor (render/cpu/scene_renderer.h), which its pictures are held against.
#pragma once

#include <map>

#include "render/scene_tiles.h"
#include "render/tile_prefetch.h"
#include "render/tile_scene.h"
#include "render/vulkan/gpu_content.h"
#include "render/vulkan/gpu_picture.h"

namespace tessera {

struct GpuRendererSettings {
  float minTransmittance = 1.0f / 255;  // rays end where less than this would be seen
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
  // Whether the same view would show more now: something has been read that the last picture had to do without.
  virtual bool hasMore() const = 0;
  struct Pixel {
    float opacity = 0, depth = 0;  // as of RenderedView
  };
  virtual Pixel pixelAt(int x, int y) = 0;  // of the last picture; waits
  virtual SceneState state() const = 0;
};

// What a content becomes on the card.
template <class Content>
struct OnCard;
template <>
struct OnCard<VolumeContent> {
  using Type = GpuVolumeContent;
};
template <>
struct OnCard<HashContent> {
  using Type = GpuHashContent;
};

// Content: VolumeContent or HashContent.
template <class Content>
class GpuSceneRenderer final : public GpuViewRenderer {
 public:
  using Held = typename OnCard<Content>::Type;

  // Throws Error where the coarsest level does not fit into the budget or the card, and in render() what the source
  // throws.
  GpuSceneRenderer(const std::shared_ptr<const GpuContext>& context, TileScene<Content> scene,
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
  const TileCache<Held>& cache() const { return tiles_.cache(); }

 private:
  // Those in front of the surround, which is the last, if there is one.
  struct Contents {
    std::vector<DrawnContent<Held>> frontToBack;
    size_t inBox = 0;
  };
  void queue(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth);
  TileSource<Held> heldFrom(const TileSource<Content>& source);
  void begin(const Contents& contents, const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth);
  void draw(const Held& content, const DrawnContent<Held>& where, bool isSurround);
  void end();
  const GpuKernel& kernel(std::span<const uint32_t> spirv, uint32_t constant);

  std::shared_ptr<GpuStream> stream_;
  std::unique_ptr<TilePrefetch<Content>> prefetch_;  // null: everything is waited for
  SceneTiles<Held> tiles_;
  GpuRendererSettings settings_;
  Eigen::Array3f background_;
  GpuPicture picture_;
  std::map<std::pair<const uint32_t*, uint32_t>, GpuKernel> kernels_;
  std::vector<const Held*> networks_;  // of `hash`: one content for each network of the picture
  bool isWhole_ = false;               // of `hash`: a content is
  GpuBuffer networkTable_;
};

// Of a scene's folder, whatever its representation. Throws Error as openTileScene and the renderer do.
std::unique_ptr<GpuViewRenderer> openGpuScene(const std::shared_ptr<const GpuContext>& context, const fs::path& folder,
                                              const GpuRendererSettings& settings);

using GpuVolumeRenderer = GpuSceneRenderer<VolumeContent>;
using GpuHashRenderer = GpuSceneRenderer<HashContent>;

}  // namespace tessera
