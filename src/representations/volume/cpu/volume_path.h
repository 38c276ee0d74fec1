// The path of a ray through the domain of one part of a content (scene/domain_path.h), measured in texels of the
// planes.
#pragma once

#include <array>

#include "raymarch/cpu/part_path.h"
#include "representations/volume/content/volume_content.h"

namespace tessera {

// The position after τ texels is start + τ direction, in texels from the lower corner of the domain, so that the domain
// is [0, planes]³.
struct VolumeSegment {
  std::array<float, 3> start, direction;  // the direction has length 1
  double length = 0;                      // texels; in double, because floats would misplace very distant ends
  // The distance along the ray in scene units is entry + square τ / (rate - growth τ).
  double entry = 0, square = 1, rate = 1, growth = 0;

  double distanceAt(double tau) const { return entry + square * tau / (rate - growth * tau); }
  // Returns distanceAt(to) - distanceAt(from) without cancellation.
  double distanceBetween(double from, double to) const {
    return square * rate * (to - from) / ((rate - growth * from) * (rate - growth * to));
  }
};

struct VolumePath {
  std::array<VolumeSegment, DomainPath::kMaxSegments> segments;
  int count = 0;
};

// Returns the path within `range`, which must be finite and, for a bounded part, within its domain.
VolumePath volumePath(const VolumePart& part, const SceneRay& ray, const RayRange& range);

}  // namespace tessera
