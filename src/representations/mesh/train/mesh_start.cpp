#include "representations/mesh/train/mesh_start.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.h"
#include "representations/field/train/field_renderer.h"

namespace tessera {
namespace {

constexpr int kPhotoStride = 3;  // pixels, of the rays that find surfaces
constexpr int kTileEdge = 8;     // pixels

// Returns the cells of the mesh that overlap with cells of the coarse field in which photos see something, or with
// their neighbours.
std::vector<bool> cellsWithSurfaces(const std::vector<uint32_t>& seen, const MarchSpace& space,
                                    const OctahedraGrid& grid) {
  const uint32_t n = grid.resolution, fieldCells = static_cast<uint32_t>(space.gridResolution);
  // The first and the last cell of the field beside each cell of the mesh, along any axis.
  std::vector<std::array<uint32_t, 2>> ranges(n);
  for (uint32_t i = 0; i < n; ++i) {
    const auto place = [&](double edge) {
      const double u = edge / n;  // 0 to 1 across the region of interest, which is half of a contracted space
      return (space.contracted ? (2 * u + 1) / 4 : u) * fieldCells;
    };
    const double low = std::floor(place(i) + 1e-6), high = std::ceil(place(i + 1.0) - 1e-6) - 1;
    ranges[i] = {static_cast<uint32_t>(low), std::min(static_cast<uint32_t>(high), fieldCells - 1)};
  }
  std::vector<bool> cells(grid.cells());
  for (uint32_t cell = 0; cell < grid.cells(); ++cell) {
    const auto &x = ranges[cell % n], &y = ranges[cell / n % n], &z = ranges[cell / (n * n)];
    bool any = false;
    for (uint32_t k = z[0]; k <= z[1]; ++k)
      for (uint32_t j = y[0]; j <= y[1]; ++j)
        for (uint32_t i = x[0]; i <= x[1]; ++i) {
          const uint32_t at = i + fieldCells * (j + fieldCells * k);
          any = any || (seen[at / 32] >> at % 32 & 1) != 0;
        }
    cells[cell] = any;
  }
  return cells;
}

// Returns the tiles of a photo whose middles see a surface in the region of interest.
TileShares tilesOfPhoto(const Capture& capture, int photo, const SceneFrame& frame, FieldRenderer& renderer) {
  const Pose& pose = capture.photos[photo].worldFromCamera;
  const Camera& camera = capture.cameras[capture.photos[photo].camera];
  const int columns = std::max(1, camera.width / kTileEdge), rows = std::max(1, camera.height / kTileEdge);
  const Camera coarse = camera.scaledTo(columns, rows);
  const RenderedView view = renderer.render(coarse, pose, nullptr);
  TileShares shares;
  double total = 0;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const float opacity = *view.opacity.at(x, y);
      const auto inCamera = coarse.directionInCamera({x + 0.5, y + 0.5});
      if (opacity < 0.5f || !inCamera || inCamera->z() <= 0) continue;
      const double depth = *view.depth.at(x, y) / opacity;
      const Vec3d world = pose.rotation * (*inCamera * (depth / inCamera->z())) + pose.translation;
      if (frame.sceneFromWorld(world).cwiseAbs().maxCoeff() > 1) continue;
      const PhotoTile tile{photo, static_cast<uint32_t>(camera.width * x / columns),
                           static_cast<uint32_t>(camera.height * y / rows),
                           static_cast<uint32_t>(camera.width * (x + 1) / columns),
                           static_cast<uint32_t>(camera.height * (y + 1) / rows)};
      total += (tile.right - tile.left) * (tile.bottom - tile.top);
      shares.tiles.push_back(tile);
      shares.until.push_back(total);
    }
  }
  return shares;
}

}  // namespace

MeshStart findMeshStart(const Capture& capture, FieldModel& coarse, const MeshConfig& config) {
  FieldRenderer renderer(coarse);
  MeshStart start;
  start.tiles.resize(capture.photos.size());
  bool any = false;
  for (const int photo : capture.photosIn(Split::train)) {
    start.tiles[photo] = tilesOfPhoto(capture, photo, coarse.frame(), renderer);
    any = any || !start.tiles[photo].tiles.empty();
  }
  CullOptions options;
  options.stride = kPhotoStride;
  renderer.cullUnseen(capture, options);
  start.cells = cellsWithSurfaces(coarse.device().read(renderer.cells()), coarse.space(), config.grid(0));
  if (!any || std::find(start.cells.begin(), start.cells.end(), true) == start.cells.end()) {
    throw Error(capture.root.string(), "transforms.json", "no training photo shows a surface in the region of interest",
                "check the camera poses and the masks, or enlarge the region with --set roi_margin=...");
  }
  return start;
}

}  // namespace tessera
