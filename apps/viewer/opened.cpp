#include "apps/viewer/opened.h"

#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

#include "apps/viewer/async_frame_source.h"
#include "apps/viewer/gpu_frame_source.h"
#include "apps/viewer/opened_world.h"
#include "apps/viewer/reloading_render_source.h"
#include "base/error.h"
#include "base/log.h"
#include "import/capture_reader.h"
#include "render/tile_scene.h"
#include "representations/gpu_drawers.h"
#include "tiles/scene_folder.h"
#include "train/model_folder.h"
#include "world/main_scene.h"

namespace tessera {
namespace {

bool isScene(const fs::path& folder) {
  return fs::exists(folder / "tileset.json");
}

bool isModel(const fs::path& folder) {
  return fs::exists(folder / "blocks.json");
}

// Sets the place's box to the box along the world's axes that encloses a box that is given in other axes.
void setBox(const Vec3d& low, const Vec3d& high, const std::function<Vec3d(const Vec3d&)>& toWorld, Place& place) {
  place.low = Vec3d::Constant(INFINITY);
  place.high = Vec3d::Constant(-INFINITY);
  enclose(low, high, toWorld, place);
}

}  // namespace

void enclose(const Vec3d& low, const Vec3d& high, const std::function<Vec3d(const Vec3d&)>& toWorld, Place& place) {
  for (int corner = 0; corner < 8; ++corner) {
    Vec3d at;
    for (int axis = 0; axis < 3; ++axis) at[axis] = (corner >> axis & 1) != 0 ? high[axis] : low[axis];
    const Vec3d inWorld = toWorld(at);
    place.low = place.low.cwiseMin(inWorld);
    place.high = place.high.cwiseMax(inWorld);
  }
}

void requireViewable(const fs::path& folder) {
  if (isScene(folder) || isModel(folder) || findWorldFile(folder)) return;
  const std::string name = folder.string(), remedy = "name the folder of a scene or of a model, or a world.json";
  if (!fs::exists(folder)) throw Error(name, "", "there is no such folder or file", remedy);
  throw Error(name, "", "holds neither a scene (tileset.json) nor a model (blocks.json) nor a world (world.json)",
              remedy);
}

std::optional<WorldToView> readWorldToView(const ViewOptions& options) {
  const std::optional<fs::path> file = findWorldFile(options.folder);
  if (!file) return std::nullopt;
  return WorldToView{*file, readWorldFile(*file)};
}

Place loadPlace(const ViewOptions& options, const std::optional<WorldToView>& world) {
  Place place;
  fs::path views = options.views;
  std::optional<Mat4d> sourceFromWorld;  // nothing if it is unknown
  if (world) {
    place = loadWorldPlace(*world);
    sourceFromWorld = readSourceFromWorld(world->world, world->file);
  } else if (isScene(options.folder)) {
    const Tileset tileset = readTileset(options.folder);
    const TileFrame frame = makeTileFrame(tileset);
    setBox(
        frame.low, frame.high,
        [&](const Vec3d& x) { return Vec3d(frame.translation + frame.scale * (frame.rotation * x)); }, place);
    sourceFromWorld = tileset.sourceFromWorld;
  } else {
    const ModelPlacement placement = ModelFolder(options.folder).readPlacement();
    if (placement.grid) {
      const BlockGrid& grid = *placement.grid;
      const Vec2d half = grid.edge / 2 * Vec2d(grid.columns, grid.rows);
      setBox(
          {-half.x(), -half.y(), grid.bottom}, {half.x(), half.y(), grid.top},
          [&](const Vec3d& x) { return grid.inWorld(x); }, place);
    } else {
      setBox(
          -Vec3d::Ones(), Vec3d::Ones(), [&](const Vec3d& x) { return placement.frame.worldFromScene(x); }, place);
    }
    sourceFromWorld = placement.sourceFromWorld;
    std::error_code status;
    if (views.empty() && fs::exists(placement.capture / "transforms.json", status)) views = placement.capture;
  }
  if (views.empty()) return place;
  Capture capture;
  try {
    capture = readCapture(views);
  } catch (const Error& error) {
    if (!options.views.empty()) throw;
    warn("{}: there are no views of photos", error.what());
    return place;
  }
  if (!sourceFromWorld) {
    warn("{}: its main scene is not there, so that it is unknown whether {} is of the same world",
         options.folder.string(), views.string());
  } else if ((capture.sourceFromWorld - *sourceFromWorld).norm() > 1e-9 * sourceFromWorld->norm()) {
    const std::string other = "its world is not the one of " + options.folder.string();
    if (!options.views.empty()) {
      throw Error(views.string(), "transforms.json", other, "use the capture that it was trained on");
    }
    warn("{}: {}: there are no views of photos", views.string(), other);
    return place;
  }
  for (NamedView& view : viewsOfCapture(capture, std::nullopt)) place.views.push_back(std::move(view));
  return place;
}

void waitForModel(const fs::path& folder) {
  if (findWorldFile(folder)) return;
  const ModelFolder model(folder);
  for (bool told = false; !isScene(folder) && !model.manifest();) {
    if (!std::exchange(told, true)) {
      inform("{}: waits for the training's first checkpoint (train --checkpoint-seconds)", folder.string());
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
  }
}

std::unique_ptr<FrameSource> openPictures(const ViewOptions& options, const std::optional<WorldToView>& world,
                                          const std::shared_ptr<const GpuContext>& window) {
  // If the GPU drives no screen, the window may be shown by a Vulkan driver for the CPU. That driver renders the scene
  // only if it was named, or if there is no GPU.
  const std::string& kind = options.device.kind;
  const bool isMeant =
      parseVulkanDevice(kind) && (!window->isCpu() || kind.starts_with("vulkan:") || !parseVulkanDevice("auto"));
  GpuRendererSettings settings;
  settings.selection.maximumScreenSpaceError = options.maximumScreenSpaceError;
  settings.budgetBytes = static_cast<uint64_t>(options.memoryMiB * 1048576);
  settings.inBackground = true;
  settings.draw.exact = false;
  if (world) return openWorldPictures(options, *world, window, settings);
  if (isScene(options.folder) && isMeant) {
    return std::make_unique<GpuFrameSource>(openGpuScene(window, options.folder, settings));
  }
  RenderSourceOptions renderSource;
  renderSource.threads = options.device.threads;
  renderSource.memoryMiB = options.memoryMiB;
  renderSource.maximumScreenSpaceError = options.maximumScreenSpaceError;
  return std::make_unique<AsyncFrameSource>(
      window, std::make_unique<ReloadingRenderSource>(options.folder, options.device, renderSource));
}

}  // namespace tessera
