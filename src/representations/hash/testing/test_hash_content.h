// For tests: `hash` contents whose features are given by a function.
#pragma once

#include <cmath>
#include <functional>

#include "base/random.h"
#include "representations/hash/content/hash_content.h"
#include "representations/hash/content/occupancy_distance.h"
#include "scene/axes.h"

namespace tessera {

// Returns the features at a place in [-h, h]³ of the domain; the first is the log density.
using TestFeatures = std::function<std::array<float, 8>(const Vec3d& place)>;

// Describes a part of which all macroblocks are stored. A cell is occupied if `occupied` returns true for its centre.
// The table holds noise with the amplitude `noise`, weighted by logits around 0.
struct TestHashPart {
  uint32_t lattice = 16, cells = 32;
  float noise = 0;
  std::function<bool(const Vec3d& place)> occupied = [](const Vec3d&) { return true; };
};

inline void makeHash(HashPart& part, const TestHashPart& options, const TestFeatures& features) {
  const RandomStream random(17, 3);
  const double half = part.halfDomain();
  part.lattice = options.lattice;
  part.columns = 16;
  part.ranges.assign(16, {-1, 1});
  part.ranges[0] = {-12, 12};
  for (size_t f = 1; f < 8; ++f) part.ranges[f] = {-4, 4};
  const uint32_t edge = options.lattice / HashPart::kMacroblock, last = options.lattice - 1;
  part.macroblocks.resize(size_t{edge} * edge * edge);
  part.cornerBytes.clear();
  for (uint32_t b = 0; b < part.macroblocks.size(); ++b) {
    part.macroblocks[b] = b;
    const uint32_t origin[3] = {b % edge * 8, b / edge % edge * 8, b / edge / edge * 8};
    for (uint32_t i = 0; i < HashPart::kStoredTexels; ++i) {
      const uint32_t corner[3] = {std::min(origin[0] + i % 9, last), std::min(origin[1] + i / 9 % 9, last),
                                  std::min(origin[2] + i / 81, last)};
      Vec3d place;
      for (int a = 0; a < 3; ++a) place[a] = -half + 2 * half * (corner[a] + 0.5) / options.lattice;
      const std::array<float, 8> values = features(place);
      for (size_t f = 0; f < 8; ++f) part.cornerBytes.push_back(part.ranges[f].encodeByte(values[f]));
      const uint64_t number =
          corner[0] + uint64_t{options.lattice} * (corner[1] + uint64_t{options.lattice} * corner[2]);
      for (uint64_t f = 0; f < 8; ++f) {
        part.cornerBytes.push_back(static_cast<uint8_t>(random.below(8 * number + f, 256)));
      }
    }
  }
  HashTable table;
  table.resolution = 2 * options.lattice;
  table.entries = 1 << 12;
  table.hashed = true;
  table.ranges.fill({-options.noise, options.noise});
  for (uint32_t i = 0; i < table.entries * 8; ++i) {
    table.bytes.push_back(static_cast<uint8_t>(random.below((uint64_t{1} << 40) + i, 256)));
  }
  part.tables = {table};
  OccupancyBits occupied(options.cells);
  for (size_t number = 0; number < occupied.count(); ++number) {
    const size_t n = options.cells, cell[3] = {number % n, number / n % n, number / n / n};
    Vec3d place;
    for (int a = 0; a < 3; ++a) place[a] = -half + 2 * half * (static_cast<double>(cell[a]) + 0.5) / options.cells;
    if (options.occupied(place)) occupied.set(number);
  }
  part.occupied = pyramidFromOccupancy(std::move(occupied));
  part.distances = octantDistances(part.occupied);
}

// Returns a random network 23 → 16 → 3 with weights in ±`strength`.
inline std::vector<DenseLayer> testHashNetwork(uint64_t seed, float strength = 1) {
  const RandomStream random(seed, 9);
  uint64_t next = 0;
  std::vector<DenseLayer> network;
  for (const auto& [inputs, outputs] : {std::pair{23u, 16u}, {16u, 3u}}) {
    DenseLayer layer{inputs, outputs, {}, {}};
    for (uint32_t i = 0; i < inputs * outputs; ++i) {
      layer.weights.push_back(strength * (2 * random.uniform(next++) - 1));
    }
    for (uint32_t i = 0; i < outputs; ++i) layer.biases.push_back(strength * (2 * random.uniform(next++) - 1));
    network.push_back(std::move(layer));
  }
  return network;
}

inline HashContent makeHashContent(std::vector<HashPart> parts, std::vector<DenseLayer> network) {
  HashContent content;
  content.step = 0.01f;
  content.network = std::move(network);
  content.parts = std::move(parts);
  return content;
}

// Returns smooth features whose density is high in some places.
inline std::array<float, 8> smoothFeatures(const Vec3d& at) {
  std::array<float, 8> f;
  f[0] = static_cast<float>(4 * std::sin(3 * at.x() + 1) * std::cos(2 * at.y()) * std::sin(2.5 * at.z() + 0.5));
  for (int k = 1; k < 8; ++k) f[k] = static_cast<float>(2 * std::sin(k * at.x() + 2 * at.y() - 1.5 * k * at.z()));
  return f;
}

}  // namespace tessera
