// The lattice of NGP-RT (section 4.1): coarse features and attention are evaluated only at the vertices of a lattice,
// where a baked grid stores them, and are interpolated in between, so that training sees what will be rendered.
#pragma once

#include "compute/operation.h"
#include "compute/virtual_grid.h"

namespace tessera {

// Interpolates each column trilinearly from the eight voxels around each sample. The grid is a VirtualGrid without
// planes.
struct LatticeForward {
  static constexpr uint32_t kColumns = 16;

  const VirtualGrid& grid;
  Count samples;
  Slice<const uint32_t> blockOfSample;  // [samples]
  Slice<const float> positions;         // [samples][3]
  Slice<const uint32_t> marks, ranks;   // from DistinctTexels; not used with shareTexels off
  Count texels;                         // from DistinctTexels: the counter is its firstTexel[blocks]
  Slice<const float> values;            // [texels][16]; texels beyond the capacity count as 0
  Matrix<float> mixed;                  // [samples], 16 columns, row-major or grouped with a width of 8
};
TESSERA_OPERATION(LatticeForward);

// Overwrites valueGradients in all rows below the count of texels.
struct LatticeBackward {
  const VirtualGrid& grid;
  uint32_t blocks = 1;
  Count samples;
  Slice<const uint32_t> blockOfSample;
  Slice<const float> positions;
  Slice<const uint32_t> marks, ranks, firstTexel;
  Count texels;
  Matrix<const float> mixedGradients;  // same layouts as `mixed`
  Slice<float> valueGradients;         // [texels][16]
};
TESSERA_OPERATION(LatticeBackward);

}  // namespace tessera
