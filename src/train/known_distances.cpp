#include "train/known_distances.h"

namespace tessera {

std::vector<std::vector<KnownDistance>> knownDistances(const Capture& capture, const SceneFrame& frame,
                                                       double mostPixelsOff) {
  std::vector<std::vector<KnownDistance>> known(capture.photos.size());
  for (const Observation& observation : capture.observations) {
    const Photo& photo = capture.photos[observation.photo];
    const SparsePoint& point = capture.points[observation.point];
    const Camera& camera = capture.cameras[photo.camera];
    if (photo.split != Split::train || !(observation.error <= mostPixelsOff)) continue;
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

}  // namespace tessera
