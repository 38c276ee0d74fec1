#include "apps/tessera/world_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "apps/tessera/scene_source.h"
#include "base/error.h"
#include "tiles/scene_folder.h"
#include "world/world_file.h"
#ifdef TESSERA_HAS_VULKAN
#include "compute/vulkan/device.h"
#include "representations/gpu_world.h"
#endif

namespace tessera {
namespace {

std::unique_ptr<ViewRenderer> makeWorldRenderer([[maybe_unused]] const Device& device, const fs::path& worldFile,
                                                [[maybe_unused]] const World& world,
                                                [[maybe_unused]] const RenderSourceOptions& options) {
#ifdef TESSERA_HAS_VULKAN
  if (const auto context = vulkanContext(device)) {
    GpuRendererSettings settings;
    settings.selection.maximumScreenSpaceError = options.maximumScreenSpaceError;
    settings.selection.finestLevel = options.level;
    settings.budgetBytes =
        options.memoryMiB > 0 ? static_cast<uint64_t>(options.memoryMiB * 1048576) : sceneBudgetBytes(device);
    return openGpuWorld(context, world, worldFile, settings);
  }
#endif
  throw Error(worldFile.string(), "", "is a world, which is drawn by Vulkan only",
              "use --device vulkan; without a GPU, Mesa's driver for the CPU draws it (mesa-vulkan-drivers)");
}

class WorldRenderSource final : public RenderSource {
 public:
  WorldRenderSource(const Device& device, const fs::path& worldFile, const RenderSourceOptions& options)
      : worldFile_(worldFile) {
    const World world = readWorldFile(worldFile);
    const auto main = std::find_if(world.scenes.begin(), world.scenes.end(),
                                   [](const WorldScene& scene) { return !scene.placement; });
    const std::string place = fmt::format("scenes[{}]", main - world.scenes.begin());
    sourceFromWorld_ = readTileset(resolveScene(worldFile, *main, place)).sourceFromWorld;
    renderer_ = makeWorldRenderer(device, worldFile, world, options);
  }

  ViewRenderer& renderer() override { return *renderer_; }
  Mat4d sourceFromWorld() const override { return sourceFromWorld_; }
  void requireMatchingWorld(const Capture& capture) const override {
    if ((capture.sourceFromWorld - sourceFromWorld_).norm() <= 1e-9 * sourceFromWorld_.norm()) return;
    throw Error(capture.root.string(), "transforms.json",
                "its world is not the one of the main scene of " + worldFile_.string(), "use that scene's capture");
  }
  std::vector<std::string> trainedOnAmong(const Capture&, Split) const override { return {}; }
  std::vector<SurfaceCoverage> coverage() const override { return {}; }

 private:
  fs::path worldFile_;
  Mat4d sourceFromWorld_;
  std::unique_ptr<ViewRenderer> renderer_;
};

}  // namespace

std::unique_ptr<RenderSource> openWorld(const Device& device, const fs::path& worldFile,
                                        const RenderSourceOptions& options) {
  return std::make_unique<WorldRenderSource>(device, worldFile, options);
}

}  // namespace tessera
