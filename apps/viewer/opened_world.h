// Opens a world (docs/world-format.md) that `tessera view` was given.
#pragma once

#include <memory>

#include "apps/viewer/opened.h"
#include "world/world_file.h"

namespace tessera {

// Returns the world file that is to be viewed, or nothing if a scene or a model is.
inline std::optional<fs::path> worldFileToView(const ViewOptions& options) {
  return findWorldFile(options.folder);
}

// Returns the box of all visible scenes, and the bookmarks as views; sets `sourceFromWorld` to that of the main scene.
Place loadWorldPlace(const World& world, const fs::path& worldFile, Mat4d& sourceFromWorld);

// Throws Error if the CPU is to draw, and as openGpuWorld does.
std::unique_ptr<FrameSource> openWorldPictures(const ViewOptions& options, const fs::path& worldFile,
                                               const std::shared_ptr<const GpuContext>& window,
                                               const GpuRendererSettings& settings);

}  // namespace tessera
