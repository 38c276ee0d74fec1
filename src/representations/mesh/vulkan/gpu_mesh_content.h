// A `mesh` content in GPU memory.
#pragma once

#include <array>
#include <vector>

#include "render/vulkan/gpu_content.h"
#include "representations/mesh/content/mesh_content.h"

namespace tessera {

// It takes no more GPU memory than the content from which it was made takes in main memory. The textures of parts whose
// maps are yet to be inferred are filled with zeros (GpuInference).
struct GpuMeshContent final : GpuContent {
  GpuMeshContent(const std::shared_ptr<GpuStream>& stream, const MeshContent& content);

  uint64_t memoryBytes() const override { return memory.bytes(); }

  struct Part {
    uint64_t address = 0;  // of its MeshPartArguments
    std::array<double, 3> origin{};
    double step = 1;
    uint32_t triangles = 0;
  };

  GpuContentMemory memory;
  std::vector<Part> parts;  // those that have triangles
  uint64_t sky = 0;         // device address of its bytes; 0: none
  uint32_t skyEdge = 0;
  uint32_t maxWidth = 0;  // of the networks' layers
};

}  // namespace tessera
