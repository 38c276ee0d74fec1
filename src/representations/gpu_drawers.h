// The drawers on a GPU of all representations that have scenes.
#pragma once

#include "base/file.h"
#include "render/vulkan/gpu_scene_renderer.h"

namespace tessera {

// CHECKs that there is a representation of that name: requireCodec() says so of scenes.
std::unique_ptr<GpuDrawer> makeGpuDrawer(std::string_view representation, const std::shared_ptr<GpuStream>& stream);

// A renderer of a scene's folder, with a stream of its own. Throws Error as openTileScene and the renderer do.
std::unique_ptr<GpuSceneRenderer> openGpuScene(const std::shared_ptr<const GpuContext>& context, const fs::path& folder,
                                               const GpuRendererSettings& settings);

}  // namespace tessera
