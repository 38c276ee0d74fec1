#include "render/cpu/volume_path.h"

#include <cmath>

#include "scene/contraction.h"

namespace tessera {
namespace {

struct LocalRay {
  Triple<double> origin, direction;  // distances along it are those of the scene

  Triple<double> at(double t) const {
    return {origin[0] + t * direction[0], origin[1] + t * direction[1], origin[2] + t * direction[2]};
  }
};

LocalRay localRay(const VolumePart& part, const SceneRay& ray) {
  LocalRay local;
  for (int a = 0; a < 3; ++a) {
    local.origin[a] = (ray.origin[a] - part.centre[a]) / part.scale[a];
    local.direction[a] = ray.direction[a] / part.scale[a];
  }
  return local;
}

// The cube, or the pyramid on the side `sign` of an axis.
struct Region {
  int axis = -1;
  double sign = 0;
  bool operator==(const Region&) const = default;
};

Region regionAt(const Triple<double>& x) {
  const int axis = farthestAxis(x);
  return std::abs(x[axis]) > 1 ? Region{axis, std::copysign(1.0, x[axis])} : Region{};
}

// With m(t) = sign · x_axis, positive and linear in t, the contracted place moves along a line with velocity v / m²,
// where v does not depend on t; hence τ = |v| (t - entry) / (m(entry) m(t)).
VolumeSegment segment(const VolumePart& part, const LocalRay& ray, const Region& region, const RayRange& range) {
  const Triple<double> x = ray.at(range.near);
  Triple<double> y = x, v = ray.direction;
  double entryM = 1, exitM = 1, mGrowth = 0;
  if (region.axis >= 0) {
    const int a = region.axis;
    mGrowth = region.sign * ray.direction[a];
    entryM = region.sign * x[a];
    exitM = region.sign * ray.at(range.far)[a];
    for (int b = 0; b < 3; ++b) {
      y[b] = x[b] / entryM;
      v[b] = region.sign * (ray.direction[b] * ray.origin[a] - ray.origin[b] * ray.direction[a]);
    }
    y[a] = region.sign * (2 - 1 / entryM);
    v[a] = ray.direction[a];
  }
  const double half = part.halfDomain(), texels = part.planes / (2 * half);
  const double speed = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  VolumeSegment result;
  for (int a = 0; a < 3; ++a) {
    result.start[a] = static_cast<float>((y[a] + half) * texels);
    result.direction[a] = static_cast<float>(v[a] / speed);
  }
  result.length = texels * speed * (range.far - range.near) / (entryM * exitM);
  result.entry = range.near;
  result.square = entryM * entryM;
  result.rate = speed * texels;
  result.growth = mGrowth * entryM;
  return result;
}

}  // namespace

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
  VolumePath path;
  if (range.empty()) return path;
  const LocalRay local = localRay(part, ray);
  if (!part.contracted) {
    path.segments[path.count++] = segment(part, local, {}, range);
    return path;
  }
  // All regions end at planes |x_a| = 1 and |x_a| = |x_b|.
  std::array<double, VolumePath::kMostSegments> ends;
  int count = 0;
  const auto add = [&](double offset, double slope) {  // where offset + t slope = 0
    const double t = -offset / slope;
    if (t > range.near && t < range.far) ends[count++] = t;
  };
  const Triple<double>&o = local.origin, &d = local.direction;
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3;
    for (const double sign : {-1.0, 1.0}) {
      add(o[a] + sign, d[a]);
      add(o[a] + sign * o[b], d[a] + sign * d[b]);
    }
  }
  std::sort(ends.begin(), ends.begin() + count);
  ends[count++] = range.far;
  RayRange piece{range.near, range.near};
  Region region;
  for (int i = 0; i < count; ++i) {
    if (ends[i] - piece.far < 1e-12 * ends[i]) continue;  // nothing but rounding
    const Region next = regionAt(local.at(0.5 * (piece.far + ends[i])));
    if (next != region && !piece.empty()) {
      path.segments[path.count++] = segment(part, local, region, piece);
      piece.near = piece.far;
    }
    region = next;
    piece.far = ends[i];
  }
  if (!piece.empty()) path.segments[path.count++] = segment(part, local, region, piece);
  return path;
}

}  // namespace tessera
