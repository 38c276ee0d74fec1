// The triangle that is visible in each pixel of a raster: of half-transparent ones, in each frame those that dithering
// selects.
#pragma once

#include "representations/mesh/vulkan/placed_parts.h"
#include "shaders/representations/mesh/arguments_mesh.h"

namespace tessera {

class VisibleLayers {
 public:
  explicit VisibleLayers(std::shared_ptr<GpuStream> stream) : stream_(std::move(stream)) {}
  ~VisibleLayers();
  VisibleLayers(const VisibleLayers&) = delete;
  VisibleLayers& operator=(const VisibleLayers&) = delete;

  // Queues the drawing of all parts into the raster of `view`, whose `visible` it sets. Parts of the background block
  // are behind all others. Throws Error if the device does not rasterise.
  void draw(arguments::MeshViewArguments& view, const PlacedParts& parts);

 private:
  void ensureRaster(ImageSize size);

  std::shared_ptr<GpuStream> stream_;
  std::unique_ptr<GpuGraphicsPipeline> pipeline_;
  std::shared_ptr<const GpuImage> image_;
  // Of the background block; then of tiles; of further parts of either.
  std::shared_ptr<const GpuRenderPass> background_, tiles_, more_;
  GpuBuffer visible_, nearest_, view_;
};

}  // namespace tessera
