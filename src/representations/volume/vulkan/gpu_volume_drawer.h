// The GPU drawer of `volume` contents.
#pragma once

#include "render/vulkan/gpu_drawer.h"

namespace tessera {

std::unique_ptr<GpuDrawer> makeGpuVolumeDrawer(const std::shared_ptr<GpuStream>& stream);

}  // namespace tessera
