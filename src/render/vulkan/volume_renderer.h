// Draws scenes of `volume` on a graphics card, with the cache and the levels of detail of the renderer on the processor
// (render/cpu/scene_renderer.h), which its pictures are held against.
#pragma once

#include <map>

#include "render/cpu/draw_scene.h"
#include "render/scene_tiles.h"
#include "render/tile_scene.h"
#include "render/vulkan/gpu_content.h"

namespace tessera {

struct GpuRendererSettings {
  float minTransmittance = 1.0f / 255;  // rays end where less than this would be seen
  SelectionSettings selection;
  uint64_t budgetBytes = uint64_t{1} << 30;  // of the card's memory, for contents
};

class GpuVolumeRenderer final : public ViewRenderer {
 public:
  // Throws Error where the coarsest level does not fit into the budget or the card, and in render() what the source
  // throws.
  GpuVolumeRenderer(std::shared_ptr<const GpuContext> context, TileScene<VolumeContent> scene,
                    const GpuRendererSettings& settings);

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override;
  std::string device() const override;
  Eigen::Array3f background() const override { return background_; }

  const TileCut& cut() const { return tiles_.cut(); }  // of the last picture
  const TileChoice& choice() const { return tiles_.choice(); }
  const TileCache<GpuVolumeContent>& cache() const { return tiles_.cache(); }

 private:
  const GpuKernel& drawKernel(uint32_t mostWidth);
  void makePictures(const Camera& camera);

  std::shared_ptr<GpuStream> stream_;
  SceneTiles<GpuVolumeContent> tiles_;
  GpuRendererSettings settings_;
  Eigen::Array3f background_;
  GpuKernel begin_, end_;
  std::map<uint32_t, GpuKernel> draw_;  // by the widest layer
  ThreadPool pool_;
  PixelDirections pixels_;
  Camera camera_;  // that the pictures are made for
  GpuBuffer directions_, opaqueDepth_, state_, drawn_;
};

}  // namespace tessera
