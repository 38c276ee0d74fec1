#include "apps/tessera/scene_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "apps/tessera/warning_renderer.h"
#include "base/error.h"
#include "base/memory.h"
#include "render/cpu/scene_renderer.h"
#include "render/tile_scene.h"
#include "representations/codecs.h"
#include "representations/cpu_drawers.h"
#include "tiles/scene_folder.h"
#ifdef TESSERA_HAS_VULKAN
#include "compute/vulkan/device.h"
#include "representations/gpu_drawers.h"
#endif

namespace tessera {
namespace {

template <class Renderer>
std::unique_ptr<ViewRenderer> warning(const fs::path& folder, const Tileset& tileset, uint64_t budgetBytes,
                                      std::unique_ptr<Renderer> renderer) {
  const Renderer& drawn = *renderer;
  return withWarnings(folder, budgetBytes, showsOutside(tileset), std::move(renderer),
                      [&drawn] { return static_cast<size_t>(drawn.choice().refused); });
}

std::unique_ptr<ViewRenderer> makeSceneRenderer([[maybe_unused]] const Device& device, const fs::path& folder,
                                                const Tileset& tileset, SceneRendererSettings settings) {
#ifdef TESSERA_HAS_VULKAN
  if (const auto context = vulkanContext(device)) {
    GpuRendererSettings ofGpu;
    ofGpu.draw = settings.draw;
    ofGpu.selection = settings.selection;
    ofGpu.budgetBytes = settings.budgetBytes;
    return warning(folder, tileset, settings.budgetBytes, openGpuScene(context, folder, ofGpu));
  }
#endif
  TileScene scene = openTileScene(folder, requireCodec(folder, tileset));
  settings.background = Eigen::Array3f(scene.background[0], scene.background[1], scene.background[2]);
  return warning(folder, tileset, settings.budgetBytes,
                 std::make_unique<SceneRenderer>(makeCpuDrawer(tileset.representation), scene.frame,
                                                 std::move(scene.tree), std::move(scene.source), settings));
}

class SceneRenderSource final : public RenderSource {
 public:
  SceneRenderSource(const Device& device, const fs::path& folder, const RenderSourceOptions& options)
      : folder_(folder), tileset_(readTileset(folder)) {
    SceneRendererSettings settings;
    // Compares with the coarsest level that has contents: a root that only groups the others counts as a level too.
    if (const uint32_t coarsest = coarsestLevel(tileset_); static_cast<uint32_t>(options.level) > coarsest) {
      throw Error(folder.string(), fmt::format("--lod {}", options.level),
                  coarsest == 0 ? "the scene has level 0 only" : fmt::format("the scene has levels 0 to {}", coarsest),
                  coarsest == 0 ? "leave it out" : "name one of those");
    }
    settings.selection.maximumScreenSpaceError = options.maximumScreenSpaceError;
    settings.selection.finestLevel = options.level;
    settings.threads = options.threads;
    settings.budgetBytes =
        options.memoryMiB > 0 ? static_cast<uint64_t>(options.memoryMiB * 1048576) : sceneBudgetBytes(device);
    renderer_ = makeSceneRenderer(device, folder, tileset_, settings);
  }

  ViewRenderer& renderer() override { return *renderer_; }
  Mat4d sourceFromWorld() const override { return tileset_.sourceFromWorld; }
  void requireMatchingWorld(const Capture& capture) const override {
    if ((capture.sourceFromWorld - tileset_.sourceFromWorld).norm() <= 1e-9 * tileset_.sourceFromWorld.norm()) return;
    throw Error(capture.root.string(), "transforms.json",
                "its world is not the one of " + folder_.string() + ", which was baked from '" + tileset_.name + "'",
                "use that capture");
  }
  std::vector<std::string> trainedOnAmong(const Capture&, Split) const override {
    return {};
  }  // scenes do not record their training photos
  std::vector<SurfaceCoverage> coverage() const override { return tileset_.coverage; }
  std::optional<ExposureResponse> exposureResponse() const override { return tileset_.exposureResponse; }

 private:
  fs::path folder_;
  Tileset tileset_;
  std::unique_ptr<ViewRenderer> renderer_;
};

}  // namespace

uint64_t sceneBudgetBytes(const Device& device) {
  if (const uint64_t own = device.ownMemory().bytes; own > 0) return own / 2;
  auto bytes = static_cast<uint64_t>(usableMemoryBytes());
#ifdef TESSERA_HAS_VULKAN
  // A GPU that shares the machine's memory may address a part of it alone.
  if (const auto context = vulkanContext(device)) bytes = std::min(bytes, context->memoryBytes());
#endif
  return bytes / 2;
}

std::unique_ptr<RenderSource> openScene(const Device& device, const fs::path& folder,
                                        const RenderSourceOptions& options) {
  return std::make_unique<SceneRenderSource>(device, folder, options);
}

}  // namespace tessera
