// Opens worlds (docs/world-format.md) as render sources.
#pragma once

#include "apps/tessera/render_source.h"

namespace tessera {

// Throws Error if the device is not Vulkan, as readWorldFile and openGpuWorld do, and if the main scene is missing,
// unless it is invisible; then only sourceFromWorld() of the result throws it.
std::unique_ptr<RenderSource> openWorld(const Device& device, const fs::path& worldFile,
                                        const RenderSourceOptions& options);

}  // namespace tessera
