#include "render/cpu/volume_path.h"

namespace tessera {

RayRange ownedRange(const VolumePart& part, const SceneRay& ray, const RayRange& range) {
  Vec3d low, high;
  for (int a = 0; a < 3; ++a) {
    low[a] = part.low[a];
    high[a] = part.high[a];
    if (part.contracted) continue;
    low[a] = std::max<double>(low[a], part.centre[a] - part.scale[a]);
    high[a] = std::min<double>(high[a], part.centre[a] + part.scale[a]);
  }
  return clipToBox(ray, low, high, range);
}

VolumePath volumePath(const VolumePart& part, const SceneRay& ray, const RayRange& range) {
  BlockDomain domain;
  for (int a = 0; a < 3; ++a) {
    domain.centre[a] = part.centre[a];
    domain.scale[a] = part.scale[a];
  }
  domain.contracted = part.contracted;
  const auto triple = [](const Vec3d& x) { return Triple<double>{x[0], x[1], x[2]}; };
  const DomainPath inDomain = domainPath(domain, triple(ray.origin), triple(ray.direction), range.near, range.far);
  const double texels = part.planes / (2 * domain.half());
  VolumePath path;
  for (; path.count < inDomain.count; ++path.count) {
    const DomainSegment& from = inDomain.segments[path.count];
    VolumeSegment& to = path.segments[path.count];
    for (int a = 0; a < 3; ++a) {
      to.start[a] = static_cast<float>((from.start[a] + domain.half()) * texels);
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
