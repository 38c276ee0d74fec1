#include "scene/domain_path.h"

#include <algorithm>

namespace tessera {
namespace {

struct LocalRay {
  Triple<double> origin, direction;  // parametrised by the scene's distance

  Triple<double> at(double t) const {
    return {origin[0] + t * direction[0], origin[1] + t * direction[1], origin[2] + t * direction[2]};
  }
};

// A region of the contraction: the cube (axis -1), or the pyramid on the side `sign` of an axis.
struct Region {
  int axis = -1;
  double sign = 0;
  bool operator==(const Region&) const = default;
};

Region regionAt(const Triple<double>& x) {
  const int axis = farthestAxis(x);
  return std::abs(x[axis]) > 1 ? Region{axis, std::copysign(1.0, x[axis])} : Region{};
}

// With m(t) = sign · x_axis, positive and linear in t, the contracted point moves along a line with velocity v / m²,
// where v does not depend on t; hence τ = |v| (t - entry) / (m(entry) m(t)).
DomainSegment makeSegment(const LocalRay& ray, const Region& region, double near, double far) {
  const Triple<double> x = ray.at(near);
  Triple<double> y = x, v = ray.direction;
  double entryM = 1, exitM = 1, mGrowth = 0;
  if (region.axis >= 0) {
    const int a = region.axis;
    mGrowth = region.sign * ray.direction[a];
    entryM = region.sign * x[a];
    exitM = region.sign * ray.at(far)[a];
    for (int b = 0; b < 3; ++b) {
      y[b] = x[b] / entryM;
      v[b] = region.sign * (ray.direction[b] * ray.origin[a] - ray.origin[b] * ray.direction[a]);
    }
    y[a] = region.sign * (2 - 1 / entryM);
    v[a] = ray.direction[a];
  }
  const double speed = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  DomainSegment result;
  result.start = y;
  for (int a = 0; a < 3; ++a) result.direction[a] = v[a] / speed;
  result.length = speed * (far - near) / (entryM * exitM);
  result.entry = near;
  result.square = entryM * entryM;
  result.rate = speed;
  result.growth = mGrowth * entryM;
  return result;
}

}  // namespace

DomainPath domainPath(const BlockDomain& domain, const Triple<double>& origin, const Triple<double>& direction,
                      double near, double far) {
  DomainPath path;
  if (!(near < far)) return path;
  LocalRay local;
  for (int a = 0; a < 3; ++a) {
    local.origin[a] = (origin[a] - domain.centre[a]) / domain.scale[a];
    local.direction[a] = direction[a] / domain.scale[a];
  }
  if (!domain.contracted) {
    path.segments[path.count++] = makeSegment(local, {}, near, far);
    return path;
  }
  // All regions are bounded by planes |x_a| = 1 and |x_a| = |x_b|.
  std::array<double, DomainPath::kMaxSegments> ends;
  int count = 0;
  const auto add = [&](double offset, double slope) {  // where offset + t slope = 0
    const double t = -offset / slope;
    if (t > near && t < far) ends[count++] = t;
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
  ends[count++] = far;
  double from = near, to = near;
  Region region;
  for (int i = 0; i < count; ++i) {
    if (ends[i] - to < 1e-12 * ends[i]) continue;  // an artefact of rounding
    const Region next = regionAt(local.at(0.5 * (to + ends[i])));
    if (next != region && from < to) {
      path.segments[path.count++] = makeSegment(local, region, from, to);
      from = to;
    }
    region = next;
    to = ends[i];
  }
  if (from < to) path.segments[path.count++] = makeSegment(local, region, from, to);
  return path;
}

}  // namespace tessera
