// The corners of the grid cells around a group of samples, on the CPU.
#pragma once

#include <cstdint>

namespace tessera::cpu {

inline constexpr int kGroup = 32;  // samples whose indices are computed together

// The eight corners of the samples of a group: bits 0, 1 and 2 of corner c select the upper neighbour in x, y and z.
struct Corners {
  alignas(64) uint32_t index[8][kGroup];
  alignas(64) float weight[8][kGroup];
  alignas(64) uint32_t cell[3][kGroup];
  alignas(64) float fraction[3][kGroup];
};

}  // namespace tessera::cpu
