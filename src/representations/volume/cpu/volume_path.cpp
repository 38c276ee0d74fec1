#include "representations/volume/cpu/volume_path.h"

namespace tessera {

VolumePath volumePath(const VolumePart& part, const SceneRay& ray, const RayRange& range) {
  const DomainPath inDomain = partPath(part, ray, range);
  const double half = part.halfDomain(), texels = part.planes / (2 * half);
  VolumePath path;
  for (; path.count < inDomain.count; ++path.count) {
    const DomainSegment& from = inDomain.segments[path.count];
    VolumeSegment& to = path.segments[path.count];
    for (int a = 0; a < 3; ++a) {
      to.start[a] = static_cast<float>((from.start[a] + half) * texels);
      to.direction[a] = static_cast<float>(from.direction[a]);
    }
    to.length = from.length * texels;
    to.entry = from.entry;
    to.square = from.square;
    to.rate = from.rate * texels;
    to.growth = from.growth;
  }
  return path;
}

}  // namespace tessera
