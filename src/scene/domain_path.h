// A ray through the domain of a block: straight pieces, measured in units of the domain. A bounded block has one; a
// contracted one as many as the ray meets regions of the contraction, at most five (City-on-Web, section 4.4; MERF,
// section 4.1).
#pragma once

#include <algorithm>

#include "scene/contraction.h"

namespace tessera {

// Local coordinates are q = (x - centre) / scale per axis. A bounded block's domain is [-1,1]³ and holds q; a
// contracted one's is [-2,2]³ and holds the contraction of q.
struct BlockDomain {
  Triple<double> centre = {0, 0, 0}, scale = {1, 1, 1};
  bool contracted = false;
  double half() const { return contracted ? 2 : 1; }
};

// The place after a length τ is start + τ direction, in the domain. Within a region the contraction is a projective
// map, and so is the distance along the ray as a function of τ.
struct DomainSegment {
  Triple<double> start, direction;  // the direction has length 1
  double length = 0;
  double entry = 0, square = 1, rate = 1, growth = 0;

  double distanceAt(double tau) const { return entry + square * tau / (rate - growth * tau); }
  // distanceAt(to) - distanceAt(from), without the loss of digits.
  double distanceBetween(double from, double to) const {
    return square * rate * (to - from) / ((rate - growth * from) * (rate - growth * to));
  }
};

struct DomainPath {
  // A ray meets at most five regions. Along the border of two, rounding may tell them apart at random: then more.
  static constexpr int kMostSegments = 13;
  std::array<DomainSegment, kMostSegments> segments;
  int count = 0;

  DomainPath() = default;
  // Of the segments only those that there are: mostly one of many.
  DomainPath(const DomainPath& other) { *this = other; }
  DomainPath& operator=(const DomainPath& other) {
    count = other.count;
    std::copy_n(other.segments.begin(), count, segments.begin());
    return *this;
  }
};

// The ray origin + t direction (scene units) for t from near to far, both finite; nothing unless near < far. Of a
// bounded block the range lies in its domain.
DomainPath domainPath(const BlockDomain& domain, const Triple<double>& origin, const Triple<double>& direction,
                      double near, double far);

}  // namespace tessera
