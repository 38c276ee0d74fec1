// NGP-RT's lattice (section 4.1): coarse features and attention are asked for at the corners of a lattice alone, as a
// baked grid will hold them, and interpolated, so that training sees what will be drawn.
#pragma once

#include "compute/operation.h"
#include "compute/virtual_grid.h"

namespace tessera {

// Per sample and column, the trilinear mix of the eight voxels around it (VirtualGrid of voxels alone).
struct LatticeForward {
  static constexpr uint32_t kColumns = 16;

  const VirtualGrid& grid;
  Count samples;
  Slice<const uint32_t> blockOfSample;  // [samples]
  Slice<const float> positions;         // [samples][3]
  Slice<const uint32_t> marks, ranks;   // of DistinctTexels; not with shareTexels off
  Count texels;                         // of DistinctTexels: the counter is its firstTexel[blocks]
  Slice<const float> values;            // [texels][16]; those of texels beyond the capacity count as 0
  Matrix<float> mixed;                  // [samples], 16 columns: a row is one run, or groups of 8
};
TESSERA_OPERATION(LatticeForward);

// Overwrites valueGradients of all rows below the count of texels.
struct LatticeBackward {
  const VirtualGrid& grid;
  uint32_t blocks = 1;
  Count samples;
  Slice<const uint32_t> blockOfSample;
  Slice<const float> positions;
  Slice<const uint32_t> marks, ranks, firstTexel;
  Count texels;
  Matrix<const float> mixedGradients;  // as `mixed`
  Slice<float> valueGradients;         // [texels][16]
};
TESSERA_OPERATION(LatticeBackward);

}  // namespace tessera
