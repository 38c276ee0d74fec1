// mesh_holes SCENE CAPTURE [SCREEN_SPACE_ERROR [PHOTOS]]: how many pixels of fresh views show a hole in the blocks of a
// mesh scene. CAPTURE holds photos of the same synthetic city from other places, with exact depths. A pixel is counted
// if its surface lies in the scene's box, and is a hole if the blocks, without background and sky, cover less than half
// of it. SCREEN_SPACE_ERROR: larger ones mix levels of detail; 1.5 by default. PHOTOS: the capture that the scene was
// trained on, for the number of holes whose surface none of its training photos shows. Prints JSON. See mesh.sh.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "base/error.h"
#include "base/image_io.h"
#include "bench/mesh_scene.h"
#include "bench/synthetic_city.h"
#include "import/capture_reader.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

// Draws the blocks alone: the background would hide holes.
class BlocksDrawer final : public ChangedMeshDrawer {
 public:
  RenderedView draw(const SceneView<Content>& view, const ViewRequest& request, const DrawSettings& settings,
                    ThreadPool& pool, DrawCounts& counts) override {
    SceneView<Content> blocks = view;
    blocks.backgroundBlock = nullptr;
    return ChangedMeshDrawer::draw(blocks, request, settings, pool, counts);
  }
};

// The surfaces of the city that holes should show.
class HoleSurfaces {
 public:
  // photos: if it is there, the capture with the training photos.
  HoleSurfaces(const fs::path& capture, const std::optional<fs::path>& photos)
      : pool_(0), city_(rebuildCity(capture, pool_)) {
    if (photos) photos_ = readCapture(*photos);
  }

  void add(const Ray& ray, bool showsNothing) {
    const auto hit = city_->tracer->intersect(ray);
    ++ofClass_[static_cast<size_t>(hit ? static_cast<int>(classOfMaterial(hit->material)) : kSky)];
    showNothing_ += showsNothing ? 1 : 0;
    if (hit && photos_ && !isInPhoto(hit->position)) ++inNoPhoto_;
  }

  void describe(nlohmann::ordered_json& result) const {
    result["hole_pixels_without_any_surface"] = showNothing_;
    for (size_t i = 0; i < ofClass_.size(); ++i) result["hole_pixels_of"][kClassNames[i]] = ofClass_[i];
    if (photos_) result["hole_pixels_in_no_photo"] = inNoPhoto_;
  }

 private:
  bool isInPhoto(const Vec3f& at) const {
    constexpr float kBefore = 0.05f;  // metres
    for (const int number : photos_->photosIn(Split::train)) {
      const Photo& photo = photos_->photos[number];
      const Camera& camera = photos_->cameras[photo.camera];
      const auto pixel = camera.pixelFromCamera(photo.worldFromCamera.inverse() * at.cast<double>());
      if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() >= camera.width || pixel->y() >= camera.height)
        continue;
      auto ray = rayThrough(camera, photo.worldFromCamera, *pixel);
      if (!ray) continue;
      ray->far = (at - ray->origin).norm() - kBefore;
      if (!city_->tracer->occluded(*ray)) return true;
    }
    return false;
  }

  ThreadPool pool_;
  std::unique_ptr<CityScene> city_;
  std::optional<Capture> photos_;
  std::array<uint64_t, kSurfaceClasses + 1> ofClass_{};
  uint64_t showNothing_ = 0, inNoPhoto_ = 0;
};

nlohmann::ordered_json countHoles(const fs::path& folder, const fs::path& captureFolder, double screenSpaceError,
                                  const std::optional<fs::path>& photos) {
  const Capture capture = readCapture(captureFolder);
  HoleSurfaces surfacesOfHoles(captureFolder, photos);
  const Tileset tileset = readTileset(folder);
  // The city is the same, but the capture's world need not be.
  const Mat4d worldFromCapture = tileset.sourceFromWorld.inverse() * capture.sourceFromWorld;
  const OpenedMeshScene scene = openMeshScene(folder, std::make_unique<BlocksDrawer>(), screenSpaceError);
  const TileFrame& frame = scene.frame;
  SceneRenderer& renderer = *scene.renderer;
  uint64_t surfaces = 0, holes = 0, views = 0;
  std::set<int> levels;
  std::vector<double> shares;
  for (const Photo& photo : capture.photos) {
    if (photo.depth.empty()) continue;
    const Camera& camera = capture.cameras[photo.camera];
    Pose pose;
    pose.rotation = worldFromCapture.topLeftCorner<3, 3>() * photo.worldFromCamera.rotation;
    pose.translation = (worldFromCapture * photo.worldFromCamera.translation.homogeneous()).head<3>();
    const ImageF depth = readDepth(photo.depth, photo.depthUnit);
    const RenderedView view = renderer.render(camera, pose, nullptr);
    for (const SelectedTile& tile : renderer.cut().tiles)
      if (tile.visible) levels.insert(scene.tree.tiles[static_cast<size_t>(tile.content)].level);
    uint64_t ofView = 0, holesOfView = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const float z = *depth.at(x, y);
        const auto inCamera = camera.directionInCamera({x + 0.5, y + 0.5});
        if (!(z > 0) || !std::isfinite(z) || !inCamera) continue;
        const Vec3d at = frame.inScene(pose.translation + pose.rotation * *inCamera * (z / inCamera->z()));
        if ((at.array() < frame.low.array()).any() || (at.array() > frame.high.array()).any()) continue;
        ++ofView;
        const float opacity = *view.opacity.at(x, y);
        if (opacity >= 0.5f) continue;
        ++holesOfView;
        surfacesOfHoles.add(*rayThrough(camera, photo.worldFromCamera, {x + 0.5, y + 0.5}), opacity == 0);
      }
    }
    surfaces += ofView;
    holes += holesOfView;
    ++views;
    if (ofView > 0) shares.push_back(static_cast<double>(holesOfView) / static_cast<double>(ofView));
  }
  std::sort(shares.begin(), shares.end());
  nlohmann::ordered_json result = {
      {"views", views},
      {"levels", levels},
      {"surface_pixels", surfaces},
      {"hole_pixels", holes},
      {"share", static_cast<double>(holes) / static_cast<double>(std::max<uint64_t>(1, surfaces))},
      {"largest_share_of_a_view", shares.empty() ? 0 : shares.back()}};
  surfacesOfHoles.describe(result);
  return result;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: mesh_holes SCENE CAPTURE [SCREEN_SPACE_ERROR [PHOTOS]]\n");
    return 2;
  }
  try {
    const double error = argc > 3 ? std::atof(argv[3]) : tessera::SelectionSettings().maximumScreenSpaceError;
    const auto photos = argc > 4 ? std::optional<tessera::fs::path>(argv[4]) : std::nullopt;
    std::printf("%s\n", tessera::countHoles(argv[1], argv[2], error, photos).dump(2).c_str());
    return 0;
  } catch (const tessera::Error& error) {
    std::fprintf(stderr, "mesh_holes: error: %s\n", error.what());
    return 1;
  }
}
