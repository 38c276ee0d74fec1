// Multi-resolution hash grid (Müller et al. 2022, section 3), in tiny-cuda-nn's convention.
//
//   position of a sample in level l     scale_l · x + 0.5,  x in [0,1]³
//   value                               trilinear interpolation of the 8 surrounding table entries
//   entry of lattice corner c           dense row-major if resolution³ entries fit, otherwise
//                                       (c.x) xor (c.y · 2654435761) xor (c.z · 805459861) mod entries
#pragma once

#include <array>
#include <vector>

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

struct HashGridOptions {
  int levels = 16;
  int features = 2;        // per entry: 1, 2, 4 or 8
  int log2TableSize = 17;  // log2 of the maximum number of entries per level
  int baseResolution = 16;
  int finestResolution = 2048;
};

struct HashGridLevel {
  float scale = 0;          // resolution - 1, before the resolution is rounded up
  uint32_t resolution = 0;  // lattice points per axis
  uint32_t entries = 0;     // a multiple of 8; a power of two if hashed
  bool hashed = false;
  size_t firstEntry = 0;  // index of the first entry of this level in the table of all levels
};

struct HashGrid {
  int features = 2;
  std::vector<HashGridLevel> levels;

  // Resolutions are computed in double with a tolerance of 1e-6, so that trainer and renderer never differ by one.
  explicit HashGrid(const HashGridOptions& options = {});

  uint32_t columns() const { return static_cast<uint32_t>(levels.size()) * features; }
  size_t entries() const { return levels.back().firstEntry + levels.back().entries; }
  size_t parameters() const { return entries() * features; }
};

// The table entry (within its level) of a lattice corner.
inline uint32_t hashGridIndex(const HashGridLevel& level, uint32_t x, uint32_t y, uint32_t z) {
  if (level.hashed) return (x ^ (y * 2654435761u) ^ (z * 805459861u)) & (level.entries - 1);
  return (x + level.resolution * (y + level.resolution * z)) % level.entries;
}

// HashGridForward and HashGridBackward can work on part of the rows (Count::first).
struct HashGridForward {
  const HashGrid& grid;
  Count samples;
  Slice<const float> positions;  // [capacity][3], in [0,1]
  Slice<const float> table;      // [grid.entries()][features]
  Matrix<float> encoded;         // [capacity][grid.columns()], grouped by level
};
TESSERA_OPERATION(HashGridForward);

// Adds to `tableGradients`; overwrites `positionGradients`. At least one of them is given.
struct HashGridBackward {
  const HashGrid& grid;
  Count samples;
  Slice<const float> positions;
  Slice<const float> table;              // read only for position gradients
  Matrix<const float> encodedGradients;  // same layout as `encoded`
  Slice<float> tableGradients;           // optional, [grid.entries()][features]
  Slice<float> positionGradients;        // optional, [capacity][3]
};
TESSERA_OPERATION(HashGridBackward);

}  // namespace tessera
