// For tests: marches through one part of a `hash` content exactly as docs/tile-format.md, section 7, defines it, in
// double precision and without acceleration.
#pragma once

#include <algorithm>

#include "raymarch/testing/reference_path.h"
#include "representations/hash/content/hash_content.h"

namespace tessera {

// Computes the eight features at a place in [0,1]³ of the domain. Returns false where the content is empty.
inline bool referenceFeatures(const HashContent& content, const HashPart& part, const Triple<double>& p,
                              double features[8]) {
  const int cells = static_cast<int>(part.cells()), blocks = static_cast<int>(part.lattice / 8);
  uint32_t cell[3];
  int block[3], index[3];
  double fraction[3];
  for (size_t a = 0; a < 3; ++a) {
    cell[a] = static_cast<uint32_t>(std::clamp(static_cast<int>(std::floor(p[a] * cells)), 0, cells - 1));
    const double u = std::clamp(p[a] * part.lattice - 0.5, 0.0, part.lattice - 1.0);
    block[a] = static_cast<int>(std::floor(u / 8));
    index[a] = static_cast<int>(std::floor(u));
    fraction[a] = u - index[a];
  }
  if (!part.occupied.levels[0].at(cell[0], cell[1], cell[2])) return false;
  const uint32_t stored = part.macroblocks[static_cast<size_t>(block[0] + blocks * (block[1] + blocks * block[2]))];
  if (stored == HashPart::kEmpty) return false;
  const auto decodeByte = [](const ByteRange& range, uint8_t byte) {
    return static_cast<double>(range.low) + (static_cast<double>(range.high) - range.low) * byte / 255;
  };
  double columns[16] = {};
  for (int corner = 0; corner < 8; ++corner) {
    size_t at = 0;
    double weight = 1;
    for (int a = 2; a >= 0; --a) {
      const int up = corner >> a & 1;
      at = 9 * at + static_cast<size_t>(index[a] - 8 * block[a] + up);
      weight *= up ? fraction[a] : 1 - fraction[a];
    }
    for (size_t c = 0; c < part.columns; ++c) {
      columns[c] +=
          weight * decodeByte(part.ranges[c], part.cornerBytes[(stored * size_t{729} + at) * part.columns + c]);
    }
  }
  for (int f = 0; f < 8; ++f) features[f] = columns[f];
  for (size_t l = 0; l < part.tables.size(); ++l) {
    const HashTable& table = part.tables[l];
    double fine[8] = {};
    for (int corner = 0; corner < 8; ++corner) {
      uint32_t point[3];
      double weight = 1;
      for (size_t a = 0; a < 3; ++a) {
        const double place = (table.resolution - 1) * p[a] + 0.5, low = std::floor(place);
        const int up = corner >> a & 1;
        point[a] = static_cast<uint32_t>(low) + static_cast<uint32_t>(up);
        weight *= up ? place - low : 1 - (place - low);
      }
      const uint32_t entry =
          table.hashed ? (point[0] ^ (2654435761u * point[1]) ^ (805459861u * point[2])) % table.entries
                       : (point[0] + table.resolution * (point[1] + table.resolution * point[2])) % table.entries;
      for (size_t f = 0; f < 8; ++f)
        fine[f] += weight * decodeByte(table.ranges[f], table.bytes[8 * size_t{entry} + f]);
    }
    const auto sigmoid = [](double x) { return 1 / (1 + std::exp(-x)); };
    const uint32_t n = content.logitsOfLevel();
    const auto levelWeight = [&](uint32_t which) {
      if (n == 0) return 1.0;
      const size_t number = n * l + std::min(which, n - 1);
      return sigmoid(content.logits.empty() ? columns[8 + number] : static_cast<double>(content.logits[number]));
    };
    for (int f = 0; f < 8; ++f) features[f] += levelWeight(f == 0 ? 0 : 1) * fine[f];
  }
  return true;
}

// Composites the samples of a ray. Diffuse colour and features are weighted sums without any activation.
inline void referenceMarch(const HashContent& content, const HashPart& part, const SceneRay& ray, RayRange range,
                           ReferenceComposite& out) {
  const double step = 2.0 * part.halfDomain() * content.step;
  referenceWalk(part, step, ray, range, [&](const Triple<double>& p, double from, double to, double middle) {
    double features[8];
    if (!referenceFeatures(content, part, p, features)) return;
    ++out.samples;
    const double alpha = -std::expm1(-std::exp(std::min(features[0], 15.0)) * std::min(to - from, 1000.0));
    for (int k = 0; k < 7; ++k) out.values[k] += out.transmittance * alpha * features[k + 1];
    out.depth += out.transmittance * alpha * middle;
    out.transmittance *= 1 - alpha;
  });
}

}  // namespace tessera
