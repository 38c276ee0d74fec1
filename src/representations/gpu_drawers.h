// The GPU drawers of all representations that have scenes.
#pragma once

#include "base/file.h"
#include "render/vulkan/gpu_scene_renderer.h"

namespace tessera {

// Returns a GPU drawer for the named representation. CHECKs that it exists.
std::unique_ptr<GpuDrawer> makeGpuDrawer(std::string_view representation, const std::shared_ptr<GpuStream>& stream);

// Opens the scene in `folder` and returns a renderer for it, which owns its stream. Throws Error under the conditions
// of openTileScene and of the GpuSceneRenderer constructor.
std::unique_ptr<GpuSceneRenderer> openGpuScene(const std::shared_ptr<const GpuContext>& context, const fs::path& folder,
                                               const GpuRendererSettings& settings);

}  // namespace tessera
