#include "train/visible_cells.h"

#include <algorithm>
#include <cmath>

#include "base/order_statistics.h"
#include "base/threads.h"

namespace tessera {
namespace {

constexpr int kBlock = 2;               // visibility is tested for blocks of 2³ cells
constexpr size_t kEnough = 20;          // minimum number of observations of a photo
constexpr double kNearestShare = 0.02;  // share of the observations that are taken for outliers
constexpr double kSlack = 0.25;         // of the image width: other views look slightly beyond what photos show

// Computes the point in block coordinates from grid coordinates. Returns false if no point of the scene maps there.
bool blockFromGrid(const MarchSpace& space, const Vec3d& u, Vec3d* x) {
  if (!space.contracted) {
    *x = 2 * u - Vec3d::Ones();
    return true;
  }
  const Vec3d y = 4 * u - Vec3d::Constant(2);
  int axis = 0, outside = 0;
  for (int a = 0; a < 3; ++a) {
    outside += std::abs(y[a]) > 1;
    if (std::abs(y[a]) > std::abs(y[axis])) axis = a;
  }
  if (outside > 1) return false;
  *x = y;
  if (outside == 0) return true;
  const double m = 1 / std::max(1e-3, 2 - std::abs(y[axis]));
  *x = y * m;
  (*x)[axis] = y[axis] < 0 ? -m : m;
  return true;
}

struct View {
  const Camera* camera;
  Pose cameraFromWorld;
  double near;
  double slack;  // margin around the image, pixels
};

// Returns the depth along the optical axis or, for fisheyes, which see behind the image plane, along the ray.
double cameraDepth(const Camera& camera, const Vec3d& xInCamera) {
  return lensSeesBehind(camera.lens) ? xInCamera.norm() : xInCamera.z();
}

bool sees(const View& view, const Vec3d& xInWorld) {
  const Vec3d x = view.cameraFromWorld * xInWorld;
  if (cameraDepth(*view.camera, x) < view.near) return false;
  const std::optional<Vec2d> pixel = view.camera->pixelFromCamera(x);
  return pixel && pixel->x() > -view.slack && pixel->y() > -view.slack &&
         pixel->x() < view.camera->width + view.slack && pixel->y() < view.camera->height + view.slack;
}

}  // namespace

std::vector<double> nearestSparseDepth(const Capture& capture) {
  std::vector<std::vector<double>> depths(capture.photos.size());
  for (const Observation& observation : capture.observations) {
    const Photo& photo = capture.photos[observation.photo];
    const double depth = cameraDepth(capture.cameras[photo.camera],
                                     photo.worldFromCamera.inverse() * capture.points[observation.point].xInWorld);
    if (depth > 0) depths[observation.photo].push_back(depth);
  }
  std::vector<double> nearest(capture.photos.size(), 0.0);
  for (size_t photo = 0; photo < depths.size(); ++photo) {
    std::vector<double>& values = depths[photo];
    if (values.size() < kEnough) continue;
    nearest[photo] = valueOfRank(values, static_cast<size_t>(kNearestShare * static_cast<double>(values.size())));
  }
  return nearest;
}

std::vector<bool> visibleCells(const Capture& capture, const SceneFrame& frame, const MarchSpace& space,
                               const BlockDomain& block) {
  const Vec3d centre(block.centre.data()), scale(block.scale.data());
  const std::vector<double> nearest = nearestSparseDepth(capture);
  std::vector<View> views;
  for (const int photo : capture.photosIn(Split::train)) {
    const Camera& camera = capture.cameras[capture.photos[photo].camera];
    views.push_back({&camera, capture.photos[photo].worldFromCamera.inverse(),
                     std::max(space.near / frame.scale, kNearShare * nearest[photo]), kSlack * camera.width});
  }
  const int resolution = space.gridResolution, blocks = resolution / kBlock;
  std::vector<uint8_t> blockVisible(static_cast<size_t>(blocks) * blocks * blocks);
  ThreadPool pool;
  pool.run(blocks, [&](size_t z, int) {
    size_t last = 0;  // neighbouring blocks are mostly visible in the same photo
    for (int y = 0; y < blocks; ++y) {
      for (int x = 0; x < blocks; ++x) {
        bool visible = false;
        // Tests the centre and the corners, moved slightly inwards so that they lie in the block's own region of the
        // contraction.
        for (int corner = 8; corner >= 0 && !visible; --corner) {
          const double reach = corner == 8 ? 0 : 0.98;
          const Vec3d offset((corner & 1 ? 1 : -1) * reach, (corner & 2 ? 1 : -1) * reach,
                             (corner & 4 ? 1 : -1) * reach);
          const Vec3d u = (Vec3d(x, y, static_cast<double>(z)) + (offset + Vec3d::Ones()) / 2) / blocks;
          Vec3d inBlock;
          if (!blockFromGrid(space, u, &inBlock)) continue;
          const Vec3d inWorld = frame.worldFromScene(centre + scale.cwiseProduct(inBlock));
          for (size_t i = 0; i < views.size() && !visible; ++i) {
            const size_t candidate = (last + i) % views.size();
            visible = sees(views[candidate], inWorld);
            if (visible) last = candidate;
          }
        }
        blockVisible[x + static_cast<size_t>(blocks) * (y + static_cast<size_t>(blocks) * z)] = visible;
      }
    }
  });
  std::vector<bool> cells(static_cast<size_t>(resolution) * resolution * resolution);
  for (size_t cell = 0; cell < cells.size(); ++cell) {
    const size_t x = cell % resolution, y = cell / resolution % resolution, z = cell / resolution / resolution;
    cells[cell] = blockVisible[x / kBlock + blocks * (y / kBlock + blocks * (z / kBlock))];
  }
  return cells;
}

}  // namespace tessera
