#include "apps/tessera/world_source.h"

#include <fmt/format.h>

#include <algorithm>

#include "apps/tessera/scene_source.h"
#include "apps/tessera/warning_renderer.h"
#include "base/error.h"
#include "base/log.h"
#include "tiles/scene_folder.h"
#include "world/main_scene.h"
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
    std::unique_ptr<WorldRenderer> renderer = openGpuWorld(context, world, worldFile, settings);
    const WorldRenderer& drawn = *renderer;
    return withWarnings(worldFile, settings.budgetBytes, drawn.showsOutside(), std::move(renderer),
                        [&drawn] { return drawn.state().refused; });
  }
#endif
  throw Error(worldFile.string(), "", "is a world, which is drawn by Vulkan only",
              "use --device vulkan; without a GPU, Mesa's driver for the CPU draws it (mesa-vulkan-drivers)");
}

// Throws Error if no visible scene has so coarse a level.
void requireLevel(const fs::path& worldFile, const World& world, int level) {
  uint32_t coarsest = 0;
  for (size_t i = 0; level > 0 && i < world.scenes.size(); ++i) {
    if (!world.scenes[i].isVisible) continue;
    const fs::path folder = resolveScene(worldFile, world.scenes[i], fmt::format("scenes[{}]", i));
    coarsest = std::max(coarsest, coarsestLevel(readTileset(folder)));
  }
  if (static_cast<uint32_t>(level) > coarsest)
    throw Error(worldFile.string(), fmt::format("--lod {}", level),
                fmt::format("the coarsest level of its scenes is {}", coarsest), "name that or a finer one");
}

class WorldRenderSource final : public RenderSource {
 public:
  WorldRenderSource(const Device& device, const fs::path& worldFile, const RenderSourceOptions& options)
      : worldFile_(worldFile) {
    const World world = readWorldFile(worldFile);
    main_ = fmt::format("scenes[{}]", findMainScene(world));
    sourceFromWorld_ = readSourceFromWorld(world, worldFile);
    requireLevel(worldFile, world, options.level);
    renderer_ = makeWorldRenderer(device, worldFile, world, options);
  }

  ViewRenderer& renderer() override { return *renderer_; }
  Mat4d sourceFromWorld() const override {
    if (sourceFromWorld_) return *sourceFromWorld_;
    throw Error(worldFile_.string(), main_, "is not there, and camera paths are in the coordinates of its photos",
                "put that scene there, or render the views of a capture (--views)");
  }
  void requireMatchingWorld(const Capture& capture) const override {
    if (!sourceFromWorld_) {
      warn("{}: {} is not there, so that it is unknown whether {} is of the same world", worldFile_.string(), main_,
           capture.root.string());
      return;
    }
    if ((capture.sourceFromWorld - *sourceFromWorld_).norm() <= 1e-9 * sourceFromWorld_->norm()) return;
    throw Error(capture.root.string(), "transforms.json",
                "its world is not the one of the main scene of " + worldFile_.string(), "use that scene's capture");
  }
  std::vector<std::string> trainedOnAmong(const Capture&, Split) const override { return {}; }
  std::vector<SurfaceCoverage> coverage() const override { return {}; }
  std::optional<ExposureResponse> exposureResponse() const override { return std::nullopt; }

 private:
  fs::path worldFile_;
  std::string main_;                      // the place of the main scene in the file
  std::optional<Mat4d> sourceFromWorld_;  // nothing if that scene is invisible and not there
  std::unique_ptr<ViewRenderer> renderer_;
};

}  // namespace

std::unique_ptr<RenderSource> openWorld(const Device& device, const fs::path& worldFile,
                                        const RenderSourceOptions& options) {
  return std::make_unique<WorldRenderSource>(device, worldFile, options);
}

}  // namespace tessera
