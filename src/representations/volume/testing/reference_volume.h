// For tests: marches one part of a volume straight from the definition, in double precision and slowly, with each of
// the 20 texels looked up by its formula.
#pragma once

#include <algorithm>

#include "raymarch/testing/reference_path.h"
#include "representations/volume/content/volume_content.h"

namespace tessera {

// Computes the sums of dequantised attributes at a position of the domain scaled to [0,1]³. Returns false if nothing is
// stored there.
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
      const int maximum = static_cast<int>(part.planes) - 1;
      for (int corner = 0; corner < 4; ++corner) {
        const int b = std::min(low[0] + (corner & 1), maximum), c = std::min(low[1] + (corner >> 1), maximum);
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
  const double step = 2.0 * part.halfDomain() / part.planes / content.stepsPerTexel;
  referenceWalk(part, step, ray, range, [&](const Triple<double>& p, double from, double to, double middle) {
    double sums[8];
    if (!referenceSums(content, part, p, sums)) return;
    ++out.samples;
    const double alpha = -std::expm1(-std::exp(std::min(sums[0] - 1, 15.0)) * (to - from));
    for (int k = 0; k < 7; ++k) out.values[k] += out.transmittance * alpha / (1 + std::exp(-sums[k + 1]));
    out.depth += out.transmittance * alpha * middle;
    out.transmittance *= 1 - alpha;
  });
}

}  // namespace tessera
