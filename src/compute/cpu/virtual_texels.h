// The texels of a virtual grid from which a sample is interpolated, and their rows.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>

#include "compute/host_memory.h"
#include "compute/virtual_grid.h"

namespace tessera::cpu {

// The two texels along one axis and the interpolation weight of the upper one.
struct TexelPair {
  uint32_t low, high;
  float share;
};

inline TexelPair texelPair(float position, uint32_t resolution) {
  const double u = static_cast<double>(position) * resolution - 0.5;
  const double floor = std::floor(u);
  const int32_t low = static_cast<int32_t>(floor), last = static_cast<int32_t>(resolution) - 1;
  return {static_cast<uint32_t>(std::clamp(low, 0, last)), static_cast<uint32_t>(std::clamp(low + 1, 0, last)),
          static_cast<float>(u - floor)};
}

struct SourceCorners {  // the corners in one source: 8 in the voxels, 4 in a plane
  uint32_t texel[8];
  float weight[8];
};

inline void voxelCorners(const VirtualGrid& grid, const float* position, SourceCorners& corners) {
  const TexelPair x = texelPair(position[0], grid.voxels), y = texelPair(position[1], grid.voxels),
                  z = texelPair(position[2], grid.voxels);
  const uint32_t v = grid.voxels;
  const uint32_t line[4] = {v * (y.low + v * z.low), v * (y.high + v * z.low), v * (y.low + v * z.high),
                            v * (y.high + v * z.high)};
  const float across[4] = {(1 - y.share) * (1 - z.share), y.share * (1 - z.share), (1 - y.share) * z.share,
                           y.share * z.share};
  for (int k = 0; k < 4; ++k) {
    corners.texel[2 * k] = x.low + line[k];
    corners.texel[2 * k + 1] = x.high + line[k];
    corners.weight[2 * k] = (1 - x.share) * across[k];
    corners.weight[2 * k + 1] = x.share * across[k];
  }
}

// Maps texels to their rows.
struct Rows {
  const uint32_t* marks = nullptr;  // null: every corner has a row of its own
  const uint32_t* ranks = nullptr;
  size_t words = 0;

  size_t word(uint32_t block, uint32_t texel) const { return block * words + texel / 32; }
  uint32_t row(size_t word, uint32_t texel) const {
    return ranks[word] + static_cast<uint32_t>(std::popcount(marks[word] & ((1u << texel % 32) - 1)));
  }
};

template <class Arguments>
Rows makeTexelRows(const Arguments& a) {
  if (!a.grid.shareTexels) return {};
  return {hostPointer(a.marks), hostPointer(a.ranks), a.grid.words()};
}

}  // namespace tessera::cpu
