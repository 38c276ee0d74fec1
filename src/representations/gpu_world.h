// Opens worlds (docs/world-format.md) on the GPU, with scenes of all representations.
#pragma once

#include "base/file.h"
#include "world/vulkan/world_renderer.h"

namespace tessera {

// Opens the visible scenes and models of a world that was read from `worldFile`. The scenes share the settings' budget
// in equal parts. Throws Error as openGpuScene and readPlacedModels do, and if no scene is visible.
std::unique_ptr<WorldRenderer> openGpuWorld(const std::shared_ptr<const GpuContext>& context, const World& world,
                                            const fs::path& worldFile, const GpuRendererSettings& settings);

}  // namespace tessera
