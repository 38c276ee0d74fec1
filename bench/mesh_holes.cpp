// mesh_holes SCENE CAPTURE [SCREEN_SPACE_ERROR]: how many pixels of fresh views show a hole in the blocks of a mesh
// scene. CAPTURE holds photos of the same synthetic city from other places, with exact depths. A pixel is counted if
// its surface lies in the scene's box, and is a hole if the blocks, without background and sky, cover less than half of
// it. SCREEN_SPACE_ERROR: larger ones mix levels of detail; 1.5 by default. Prints JSON. See mesh.sh.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "base/image_io.h"
#include "bench/mesh_scene.h"
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

nlohmann::ordered_json countHoles(const fs::path& folder, const fs::path& captureFolder, double screenSpaceError) {
  const Capture capture = readCapture(captureFolder);
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
        holesOfView += *view.opacity.at(x, y) < 0.5f ? 1 : 0;
      }
    }
    surfaces += ofView;
    holes += holesOfView;
    ++views;
    if (ofView > 0) shares.push_back(static_cast<double>(holesOfView) / static_cast<double>(ofView));
  }
  std::sort(shares.begin(), shares.end());
  return {{"views", views},
          {"levels", levels},
          {"surface_pixels", surfaces},
          {"hole_pixels", holes},
          {"share", static_cast<double>(holes) / static_cast<double>(std::max<uint64_t>(1, surfaces))},
          {"largest_share_of_a_view", shares.empty() ? 0 : shares.back()}};
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: mesh_holes SCENE CAPTURE [SCREEN_SPACE_ERROR]\n");
    return 2;
  }
  try {
    const double error = argc > 3 ? std::atof(argv[3]) : tessera::SelectionSettings().maximumScreenSpaceError;
    std::printf("%s\n", tessera::countHoles(argv[1], argv[2], error).dump(2).c_str());
    return 0;
  } catch (const tessera::Error& error) {
    std::fprintf(stderr, "mesh_holes: error: %s\n", error.what());
    return 1;
  }
}
