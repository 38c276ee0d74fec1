// A `volume` content on the GPU.
#pragma once

#include "render/vulkan/gpu_content.h"
#include "representations/volume/content/volume_content.h"

namespace tessera {

// Takes no more GPU memory than the decoded content takes in CPU memory.
struct GpuVolumeContent final : GpuContent {
  GpuVolumeContent(const std::shared_ptr<GpuStream>& stream, const VolumeContent& content);

  uint64_t memoryBytes() const override { return memory.bytes(); }

  GpuContentMemory memory;
  float featureRange = 0, densityRange = 0, stepsPerTexel = 1;
  uint32_t partCount = 0;
  uint64_t parts = 0;  // device address
  GpuNetwork network;
};

}  // namespace tessera
