#include "apps/viewer/opened_world.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "apps/viewer/gpu_frame_source.h"
#include "base/error.h"
#include "render/tile_scene.h"
#include "representations/gpu_world.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

constexpr int kHeightOfBookmarks = 720;  // pixels; only the angle counts

NamedView viewOfBookmark(const Bookmark& bookmark) {
  NamedView view;
  view.name = bookmark.name;
  view.camera.width = kHeightOfBookmarks * 16 / 9;
  view.camera.height = kHeightOfBookmarks;
  const double focal = 0.5 * kHeightOfBookmarks / std::tan(0.5 * bookmark.fieldOfView * std::numbers::pi / 180);
  view.camera.parameters = {focal, focal, 0.5 * view.camera.width, 0.5 * view.camera.height};
  const Vec3d forward = (bookmark.target - bookmark.eye).normalized();
  Vec3d right = forward.cross(Vec3d::UnitZ());
  right = right.norm() > 1e-6 ? Vec3d(right.normalized()) : Vec3d::UnitX();  // straight down or up
  view.worldFromCamera.rotation << right, forward.cross(right), forward;
  view.worldFromCamera.translation = bookmark.eye;
  return view;
}

}  // namespace

Place loadWorldPlace(const WorldToView& opened) {
  const auto& [worldFile, world] = opened;
  Place place;
  place.low = Vec3d::Constant(INFINITY);
  place.high = -place.low;
  for (size_t i = 0; i < world.scenes.size(); ++i) {
    const WorldScene& scene = world.scenes[i];
    if (!scene.isVisible) continue;
    TileFrame frame = makeTileFrame(readTileset(resolveScene(worldFile, scene, fmt::format("scenes[{}]", i))));
    if (scene.placement) frame = placeFrame(frame, *scene.placement);
    enclose(
        frame.low, frame.high,
        [&](const Vec3d& x) { return Vec3d(frame.translation + frame.scale * (frame.rotation * x)); }, place);
  }
  if (place.low.x() > place.high.x()) {
    throw Error(worldFile.string(), "scenes", "are all invisible", "set \"visible\" of one to true");
  }
  for (const Bookmark& bookmark : world.bookmarks) place.views.push_back(viewOfBookmark(bookmark));
  return place;
}

std::unique_ptr<FrameSource> openWorldPictures(const ViewOptions& options, const WorldToView& opened,
                                               const std::shared_ptr<const GpuContext>& window,
                                               const GpuRendererSettings& settings) {
  if (options.device.kind != "auto" && !parseVulkanDevice(options.device.kind)) {
    throw Error(
        "--device " + options.device.kind, "", "worlds are drawn by Vulkan only",
        "use --device auto or vulkan; without a GPU, Mesa's driver for the CPU draws them (mesa-vulkan-drivers)");
  }
  return std::make_unique<GpuFrameSource>(openGpuWorld(window, opened.world, opened.file, settings));
}

}  // namespace tessera
