// Draws `hash` contents on a GPU.
#pragma once

#include "render/vulkan/gpu_drawer.h"

namespace tessera {

std::unique_ptr<GpuDrawer> makeGpuHashDrawer(const std::shared_ptr<GpuStream>& stream);

}  // namespace tessera
