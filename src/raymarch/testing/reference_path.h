// For tests: the steps of a ray through one part, computed straight from the definition, in double precision and
// slowly. Regions of the contraction are found by dense sampling, positions by contraction, and distances by its
// inverse.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "raymarch/content/content_part.h"
#include "render/tile_frame.h"
#include "scene/contraction.h"

namespace tessera {

// Calls visit(p, from, to, middle) for each step: the position of its sample in the domain scaled to [0,1]³, and the
// distances along the ray of the step's two ends and of the sample. `stepLength`: in units of the domain.
template <class Visit>
void referenceWalk(const ContentPart& part, double stepLength, const SceneRay& ray, RayRange range,
                   const Visit& visit) {
  Triple<double> o, d;
  for (int a = 0; a < 3; ++a) {
    o[a] = (ray.origin[a] - part.centre[a]) / part.scale[a];
    d[a] = ray.direction[a] / part.scale[a];
  }
  const auto at = [&](double t) { return Triple<double>{o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]}; };
  const auto regionAt = [&](double t) {
    const Triple<double> x = at(t);
    const int axis = farthestAxis(x);
    if (!part.contracted || std::abs(x[axis]) <= 1) return 0;
    return x[axis] > 0 ? axis + 1 : -axis - 1;
  };
  // Finds the regions by dense sampling and their ends by bisection. Samples are spaced reciprocally with distance,
  // because ranges reach far.
  std::vector<double> ends = {range.near};
  const int looks = 20000;
  double previous = range.near;
  for (int i = 1; i <= looks; ++i) {
    const double s = static_cast<double>(i) / looks, span = range.far - range.near;
    const double t = range.near + span * s / (1 + (1 - s) * span / 4);
    if (part.contracted && regionAt(t) != regionAt(previous)) {
      double low = previous, high = t;
      for (int k = 0; k < 80; ++k) {
        const double middle = 0.5 * (low + high);
        (regionAt(middle) == regionAt(previous) ? low : high) = middle;
      }
      ends.push_back(low);
      ends.push_back(high);
    }
    previous = t;
  }
  ends.push_back(range.far);
  const auto place = [&](double t) { return part.contracted ? contract(at(t)) : at(t); };
  const double half = part.halfDomain();
  for (size_t i = 0; i + 1 < ends.size(); i += 2) {
    const Triple<double> begin = place(ends[i]), end = place(ends[i + 1]);
    Triple<double> along;
    double length = 0;
    for (int a = 0; a < 3; ++a) {
      along[a] = end[a] - begin[a];
      length += along[a] * along[a];
    }
    length = std::sqrt(length);
    const auto onPath = [&](double tau) {
      Triple<double> y;
      for (int a = 0; a < 3; ++a) y[a] = begin[a] + tau / length * along[a];
      return y;
    };
    const auto distanceAt = [&](double tau) {
      if (tau >= length) return ends[i + 1];
      const Triple<double> x = part.contracted ? uncontract(onPath(tau)) : onPath(tau);
      double dot = 0, square = 0;
      for (int a = 0; a < 3; ++a) {
        dot += (x[a] - o[a]) * d[a];
        square += d[a] * d[a];
      }
      return dot / square;
    };
    for (int step = 0; step * stepLength < length; ++step) {
      const double from = step * stepLength, to = std::min(length, from + stepLength), tau = 0.5 * (from + to);
      const Triple<double> y = onPath(tau);
      visit(Triple<double>{(y[0] + half) / (2 * half), (y[1] + half) / (2 * half), (y[2] + half) / (2 * half)},
            distanceAt(from), distanceAt(to), distanceAt(tau));
    }
  }
}

struct ReferenceComposite {
  double values[7] = {};
  double transmittance = 1, depth = 0;
  int samples = 0;
};

}  // namespace tessera
