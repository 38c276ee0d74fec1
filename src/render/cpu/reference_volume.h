// For tests: one part marched by the definition, in double, slowly: regions of the contraction by looking, places by
// contracting, lengths by uncontracting, each of the 20 texels by its formula.
#pragma once

#include "render/tile_frame.h"
#include "scene/contraction.h"
#include "tiles/volume_content.h"

namespace tessera {

struct ReferenceComposite {
  double values[7] = {};
  double transmittance = 1, depth = 0;
  int samples = 0;
};

// Sums of dequantised attributes at a place of the domain scaled to [0,1]³; false where nothing is stored.
inline bool referenceSums(const VolumeContent& content, const VolumePart& part, const Triple<double>& p,
                          double sums[8]) {
  const int blocks = static_cast<int>(part.voxels / 8), cells = static_cast<int>(part.planes / 8);
  int cell[3], block[3], index[3];
  double u[3], fraction[3];
  for (int a = 0; a < 3; ++a) {
    cell[a] = std::clamp(static_cast<int>(std::floor(p[a] * cells)), 0, cells - 1);
    u[a] = std::clamp(p[a] * part.voxels - 0.5, 0.0, part.voxels - 1.0);
    block[a] = static_cast<int>(std::floor(u[a] / 8));
    index[a] = static_cast<int>(std::floor(u[a]));
    fraction[a] = u[a] - index[a];
  }
  if (part.distances[cell[0] + cells * (cell[1] + cells * cell[2])] > 0) return false;
  const uint32_t stored = part.macroblocks[block[0] + blocks * (block[1] + blocks * block[2])];
  if (stored == VolumePart::kEmpty) return false;
  for (int attribute = 0; attribute < 8; ++attribute) {
    const double range = attribute == 0 ? content.densityRange : content.featureRange;
    const auto value = [&](uint8_t byte) { return -range + 2 * range * byte / 255.0; };
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      size_t at = 0;
      double weight = 1;
      for (int a = 2; a >= 0; --a) {
        const int up = corner >> a & 1;
        at = 9 * at + static_cast<size_t>(index[a] - 8 * block[a] + up);
        weight *= up ? fraction[a] : 1 - fraction[a];
      }
      sum += weight * value(part.voxelBytes[(stored * size_t{729} + at) * 8 + attribute]);
    }
    for (int plane = 0; plane < 3; ++plane) {
      const int axes[2] = {plane == 0 ? 1 : 0, plane == 2 ? 1 : 2};
      int low[2];
      double part2[2];
      for (int k = 0; k < 2; ++k) {
        const double v = std::clamp(p[axes[k]] * part.planes - 0.5, 0.0, part.planes - 1.0);
        low[k] = static_cast<int>(std::floor(v));
        part2[k] = v - low[k];
      }
      const int most = static_cast<int>(part.planes) - 1;
      for (int corner = 0; corner < 4; ++corner) {
        const int b = std::min(low[0] + (corner & 1), most), c = std::min(low[1] + (corner >> 1), most);
        const double weight = (corner & 1 ? part2[0] : 1 - part2[0]) * (corner >> 1 ? part2[1] : 1 - part2[1]);
        sum += weight * value(part.planeBytes[plane][(size_t{part.planes} * c + b) * 8 + attribute]);
      }
    }
    sums[attribute] = sum;
  }
  return true;
}

inline void referenceMarch(const VolumeContent& content, const VolumePart& part, const SceneRay& ray, RayRange range,
                           ReferenceComposite& out) {
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
  // Regions by dense sampling, their ends by bisection. Reciprocal beyond 10, as distances reach far.
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
  const double half = part.halfDomain(), texel = 2 * half / part.planes;
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
    const double stepLength = texel / content.stepsPerTexel;
    for (int step = 0; step * stepLength < length; ++step) {
      const double from = step * stepLength, to = std::min(length, from + stepLength), tau = 0.5 * (from + to);
      const Triple<double> y = onPath(tau);
      double sums[8];
      if (!referenceSums(content, part,
                         {(y[0] + half) / (2 * half), (y[1] + half) / (2 * half), (y[2] + half) / (2 * half)}, sums)) {
        continue;
      }
      ++out.samples;
      const double alpha = -std::expm1(-std::exp(std::min(sums[0] - 1, 15.0)) * (distanceAt(to) - distanceAt(from)));
      for (int k = 0; k < 7; ++k) out.values[k] += out.transmittance * alpha / (1 + std::exp(-sums[k + 1]));
      out.depth += out.transmittance * alpha * distanceAt(tau);
      out.transmittance *= 1 - alpha;
    }
  }
}

}  // namespace tessera
