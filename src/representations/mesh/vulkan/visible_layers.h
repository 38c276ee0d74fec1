// The triangle that is visible in each pixel of a raster, or its colour: of half-transparent triangles, in each frame
// those that dithering selects.
#pragma once

#include <map>

#include "representations/mesh/vulkan/placed_parts.h"
#include "shaders/representations/mesh/arguments_mesh.h"

namespace tessera {

class VisibleLayers {
 public:
  // `decodesFragments`: GpuMeshSettings.
  VisibleLayers(std::shared_ptr<GpuStream> stream, bool decodesFragments)
      : stream_(std::move(stream)), decodesFragments_(decodesFragments) {}
  ~VisibleLayers();
  VisibleLayers(const VisibleLayers&) = delete;
  VisibleLayers& operator=(const VisibleLayers&) = delete;

  // Queues the drawing of all parts into the raster of `view`, whose `visible` it sets. Parts of the background block
  // are behind all others. Throws Error if the device does not rasterise.
  void draw(arguments::MeshViewArguments& view, const PlacedParts& parts);

 private:
  const GpuGraphicsPipeline& pipelineFor(uint32_t maxWidth);
  void ensureRaster(ImageSize size);

  std::shared_ptr<GpuStream> stream_;
  bool decodesFragments_;
  std::map<uint32_t, std::unique_ptr<GpuGraphicsPipeline>> pipelines_;  // by the maximum width of layers; 0: any
  std::shared_ptr<const GpuImage> image_;
  // Of the background block; then of tiles; of further parts of either.
  std::shared_ptr<const GpuRenderPass> background_, tiles_, more_;
  GpuBuffer visible_, nearest_, solid_, view_;
};

}  // namespace tessera
