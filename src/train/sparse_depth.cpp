#include "train/sparse_depth.h"

#include <algorithm>
#include <cmath>

#include "base/order_statistics.h"

namespace tessera {

std::vector<std::vector<SparseDepth>> findSparseDepths(const Capture& capture, const SceneFrame& frame,
                                                       double maxReprojectionError) {
  std::vector<std::vector<SparseDepth>> known(capture.photos.size());
  for (const Observation& observation : capture.observations) {
    const Photo& photo = capture.photos[observation.photo];
    const SparsePoint& point = capture.points[observation.point];
    const Camera& camera = capture.cameras[photo.camera];
    if (photo.split != Split::train || !(observation.error <= maxReprojectionError)) continue;
    const bool inside = observation.x >= 0 && observation.y >= 0 && observation.x < static_cast<float>(camera.width) &&
                        observation.y < static_cast<float>(camera.height);
    const Vec3d offset = point.xInWorld - photo.worldFromCamera.translation;
    const bool behind = !(offset.dot(photo.worldFromCamera.rotation.col(2)) > 0);
    if (!inside || (behind && !lensSeesBehind(camera.lens))) continue;
    known[observation.photo].push_back({static_cast<uint32_t>(observation.x), static_cast<uint32_t>(observation.y),
                                        static_cast<float>(offset.norm() * frame.scale)});
  }
  return known;
}

SparseDepthMedians::SparseDepthMedians(const Capture& capture, double maxReprojectionError)
    : photos_(capture.photos.size()) {
  const std::vector<std::vector<SparseDepth>> known = findSparseDepths(capture, SceneFrame(), maxReprojectionError);
  for (size_t k = 0; k < photos_.size(); ++k) {
    if (known[k].empty()) continue;
    const Camera& camera = capture.cameras[capture.photos[k].camera];
    PhotoMedians& photo = photos_[k];
    photo.edge = static_cast<double>(std::max(camera.width, camera.height)) / kAcross;
    photo.columns = static_cast<int>(std::ceil(camera.width / photo.edge));
    photo.rows = static_cast<int>(std::ceil(camera.height / photo.edge));
    std::vector<std::vector<float>> distances(static_cast<size_t>(photo.columns) * photo.rows);
    for (const SparseDepth& each : known[k]) {
      const size_t column = static_cast<size_t>(each.x / photo.edge), row = static_cast<size_t>(each.y / photo.edge);
      distances[column + row * photo.columns].push_back(each.distance);
    }
    photo.medians.resize(distances.size());
    for (size_t part = 0; part < distances.size(); ++part) {
      if (!distances[part].empty()) photo.medians[part] = upperMedian(distances[part]);
    }
  }
}

double SparseDepthMedians::operator()(int photo, const Vec2d& pixel) const {
  const PhotoMedians& known = photos_[photo];
  const double column = std::floor(pixel.x() / known.edge), row = std::floor(pixel.y() / known.edge);
  if (!(column >= 0 && row >= 0 && column < known.columns && row < known.rows)) return 0;
  return known.medians[static_cast<size_t>(column) + static_cast<size_t>(row) * known.columns];
}

}  // namespace tessera
