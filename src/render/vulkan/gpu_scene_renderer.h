// Draws scenes of `volume` and of `hash` on a graphics card, with the cache and the levels of detail of the renderer on
// the processor (render/cpu/scene_renderer.h), which its pictures are held against.
#pragma once

#include <map>

#include "render/scene_tiles.h"
#include "render/tile_scene.h"
#include "render/vulkan/gpu_content.h"
#include "render/vulkan/gpu_picture.h"

namespace tessera {

struct GpuRendererSettings {
  float minTransmittance = 1.0f / 255;  // rays end where less than this would be seen
  SelectionSettings selection;
  uint64_t budgetBytes = uint64_t{1} << 30;  // of the card's memory, for contents
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
class GpuSceneRenderer final : public ViewRenderer {
 public:
  using Held = typename OnCard<Content>::Type;

  // Throws Error where the coarsest level does not fit into the budget or the card, and in render() what the source
  // throws.
  GpuSceneRenderer(const std::shared_ptr<const GpuContext>& context, TileScene<Content> scene,
                   const GpuRendererSettings& settings);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override { return "vulkan " + stream_->context()->name(); }
  Eigen::Array3f background() const override { return background_; }

  const TileCut& cut() const { return tiles_.cut(); }  // of the last picture
  const TileChoice& choice() const { return tiles_.choice(); }
  const TileCache<Held>& cache() const { return tiles_.cache(); }

 private:
  // Those in front of the surround, which is the last, if there is one.
  struct Contents {
    std::vector<DrawnContent<Held>> frontToBack;
    size_t inBox = 0;
  };
  void begin(const Contents& contents, const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth);
  void draw(const Held& content, const DrawnContent<Held>& where, bool isSurround);
  void end();
  const GpuKernel& kernel(std::span<const uint32_t> spirv, uint32_t constant);

  std::shared_ptr<GpuStream> stream_;
  SceneTiles<Held> tiles_;
  GpuRendererSettings settings_;
  Eigen::Array3f background_;
  GpuPicture picture_;
  std::map<std::pair<const uint32_t*, uint32_t>, GpuKernel> kernels_;
  std::vector<const Held*> networks_;  // of `hash`: one content for each network of the picture
  bool isWhole_ = false;               // of `hash`: a content is
  GpuBuffer networkTable_;
};

using GpuVolumeRenderer = GpuSceneRenderer<VolumeContent>;
using GpuHashRenderer = GpuSceneRenderer<HashContent>;

}  // namespace tessera
