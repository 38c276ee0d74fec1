// The path of a ray through the domain of a block: straight segments, measured in units of the domain. A bounded block
// has one segment; a contracted block has one for each region of the contraction that the ray crosses, at most five
// (City-on-Web, section 4.4; MERF, section 4.1).
#pragma once

#include <algorithm>

#include "scene/contraction.h"

namespace tessera {

// Local coordinates are q = (x - centre) / scale per axis. The domain of a bounded block is [-1,1]³, in coordinates q;
// that of a contracted block is [-2,2]³, in coordinates contract(q).
struct BlockDomain {
  Triple<double> centre = {0, 0, 0}, scale = {1, 1, 1};
  bool contracted = false;
  double half() const { return contracted ? 2 : 1; }
};

// The point at length τ is start + τ direction, in the domain. Within a region the contraction is a projective map, and
// so is the distance along the ray as a function of τ.
struct DomainSegment {
  Triple<double> start, direction;  // the direction has length 1
  double length = 0;
  double entry = 0, square = 1, rate = 1, growth = 0;

  double distanceAt(double tau) const { return entry + square * tau / (rate - growth * tau); }
  // Returns distanceAt(to) - distanceAt(from) without cancellation.
  double distanceBetween(double from, double to) const {
    return square * rate * (to - from) / ((rate - growth * from) * (rate - growth * to));
  }
};

struct DomainPath {
  // A ray crosses at most five regions. More segments arise where a ray runs along the border of two regions and
  // rounding assigns its points to either.
  static constexpr int kMaxSegments = 13;
  std::array<DomainSegment, kMaxSegments> segments;
  int count = 0;

  DomainPath() = default;
  // Copies only the segments that are in use, mostly a single one.
  DomainPath(const DomainPath& other) { *this = other; }
  DomainPath& operator=(const DomainPath& other) {
    count = other.count;
    std::copy_n(other.segments.begin(), count, segments.begin());
    return *this;
  }
};

// Returns the path of the ray origin + t direction (scene units) for t from near to far, both finite; it has no
// segments unless near < far. For a bounded block the range must lie in its domain.
DomainPath domainPath(const BlockDomain& domain, const Triple<double>& origin, const Triple<double>& direction,
                      double near, double far);

}  // namespace tessera
