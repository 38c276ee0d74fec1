// For tests: random vectors and networks, and parts in a row.
#pragma once

#include <vector>

#include "base/random.h"
#include "scene/axes.h"
#include "tiles/dense_layer.h"

namespace tessera::tiles_test {

// Returns a vector uniformly distributed in the cube [-size, size]³.
inline Vec3d randomVector(const RandomStream& random, uint64_t index, double size) {
  return size * Vec3d(2 * random.uniformDouble(3 * index) - 1, 2 * random.uniformDouble(3 * index + 1) - 1,
                      2 * random.uniformDouble(3 * index + 2) - 1);
}

inline std::vector<DenseLayer> testNetwork(uint64_t seed, std::vector<uint32_t> widths) {
  const RandomStream random(seed, 0xc0);
  uint64_t next = 0;
  std::vector<DenseLayer> network;
  for (size_t i = 0; i + 1 < widths.size(); ++i) {
    DenseLayer layer{widths[i], widths[i + 1], {}, {}};
    for (uint32_t k = 0; k < layer.inputs * layer.outputs; ++k) {
      layer.weights.push_back(random.uniform(next++) - 0.5f);
    }
    for (uint32_t k = 0; k < layer.outputs; ++k) layer.biases.push_back(random.uniform(next++) - 0.5f);
    network.push_back(std::move(layer));
  }
  return network;
}

// Places the parts side by side along x, as cells of edge 2.
template <class Part>
void placeInRow(std::vector<Part>& parts) {
  for (size_t i = 0; i < parts.size(); ++i) {
    parts[i].centre[0] = 2.0f * static_cast<float>(i);
    parts[i].low[0] = parts[i].centre[0] - 1;
    parts[i].high[0] = parts[i].centre[0] + 1;
  }
}

}  // namespace tessera::tiles_test
