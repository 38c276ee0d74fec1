#include "raymarch/cpu/part_path.h"

namespace tessera {

RayRange ownedRange(const ContentPart& part, const SceneRay& ray, const RayRange& range) {
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

DomainPath partPath(const ContentPart& part, const SceneRay& ray, const RayRange& range) {
  BlockDomain domain;
  for (int a = 0; a < 3; ++a) {
    domain.centre[a] = part.centre[a];
    domain.scale[a] = part.scale[a];
  }
  domain.contracted = part.contracted;
  const auto triple = [](const Vec3d& x) { return Triple<double>{x[0], x[1], x[2]}; };
  return domainPath(domain, triple(ray.origin), triple(ray.direction), range.near, range.far);
}

}  // namespace tessera
