#include "apps/tessera/world_source.h"

#include <fmt/format.h>

#include "apps/tessera/scene_source.h"
#include "base/error.h"
#include "base/log.h"
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
    main_ = fmt::format("scenes[{}]", findMainScene(world));
    sourceFromWorld_ = readSourceFromWorld(world, worldFile);
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
