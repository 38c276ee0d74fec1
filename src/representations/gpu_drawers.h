// The GPU drawers of all representations that have scenes.
#pragma once

#include "base/file.h"
#include "render/vulkan/gpu_scene_renderer.h"

namespace tessera {

// Returns whether scenes of the named representation can be drawn on the GPU.
bool hasGpuDrawer(std::string_view representation);

// Returns a GPU drawer for the named representation. CHECKs that it exists; for scenes, call hasGpuDrawer() first.
std::unique_ptr<GpuDrawer> makeGpuDrawer(std::string_view representation, const std::shared_ptr<GpuStream>& stream);

// Opens the scene in `folder` and returns a renderer for it, which owns its stream. Throws Error if there is no drawer
// for it, and under the conditions of openTileScene and of the GpuSceneRenderer constructor.
std::unique_ptr<GpuSceneRenderer> openGpuScene(const std::shared_ptr<const GpuContext>& context, const fs::path& folder,
                                               const GpuRendererSettings& settings);

}  // namespace tessera
