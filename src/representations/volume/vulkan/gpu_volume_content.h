// A content of `volume` on a GPU.
#pragma once

#include "render/vulkan/gpu_content.h"
#include "representations/volume/content/volume_content.h"

namespace tessera {

// It takes no more of the GPU than the content that it is made of takes in memory.
struct GpuVolumeContent final : GpuContent {
  GpuVolumeContent(const std::shared_ptr<GpuStream>& stream, const VolumeContent& content);

  uint64_t memoryBytes() const override { return memory.bytes(); }

  GpuContentMemory memory;
  float featureRange = 0, densityRange = 0, stepsPerTexel = 1;
  uint32_t partCount = 0;
  uint64_t parts = 0;  // address
  GpuNetwork network;
};

}  // namespace tessera
