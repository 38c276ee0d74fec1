// Opens a world (docs/world-format.md) that `tessera view` was given.
#pragma once

#include <memory>

#include "apps/viewer/opened.h"

namespace tessera {

// Returns the box of all visible scenes, and the bookmarks as views.
Place loadWorldPlace(const WorldToView& opened);

// Throws Error if the CPU is to draw, and as openGpuWorld does.
std::unique_ptr<FrameSource> openWorldPictures(const ViewOptions& options, const WorldToView& opened,
                                               const std::shared_ptr<const GpuContext>& window,
                                               const GpuRendererSettings& settings);

}  // namespace tessera
