// Lists of all fragments of triangles in each pixel of a raster, in GPU memory.
#pragma once

#include <functional>
#include <span>

#include "representations/mesh/vulkan/placed_parts.h"
#include "shaders/representations/mesh/arguments_mesh.h"

namespace tessera {

class LayerLists {
 public:
  // `largestCapacity`: the number of fragments in memory at most; 0: what an eighth of the GPU's memory holds.
  LayerLists(std::shared_ptr<GpuStream> stream, uint32_t largestCapacity);
  ~LayerLists();
  LayerLists(const LayerLists&) = delete;
  LayerLists& operator=(const LayerLists&) = delete;

  // Lists the fragments of all parts in the raster of `view`, whose lists it sets, and calls `composite` with the rows
  // that are complete: several times if all fragments do not fit into memory. Waits for the GPU. Throws Error if the
  // device does not rasterise, or if a single row does not fit.
  void draw(arguments::MeshViewArguments view, std::span<const DrawnPart> parts,
            const std::function<void(const arguments::MeshViewArguments&)>& composite);

 private:
  void ensureRaster(ImageSize size);
  void ensureCapacity(uint32_t fragments);
  // Returns the number of fragments in the rows of `view`, of which as many are listed as there is memory for.
  uint32_t list(const arguments::MeshViewArguments& view, std::span<const DrawnPart> parts);

  std::shared_ptr<GpuStream> stream_;
  std::unique_ptr<GpuGraphicsPipeline> pipeline_;
  std::shared_ptr<const GpuRenderPass> pass_;
  GpuBuffer heads_, nodes_, counter_, view_;
  uint32_t capacity_ = 0, largestCapacity_ = 0;
};

}  // namespace tessera
