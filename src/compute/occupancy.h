// The occupancy grid of instant-ngp (Müller et al. 2022, appendix C), one grid over contracted space.
#pragma once

#include "compute/memory.h"
#include "compute/operation.h"
#include "compute/rays.h"

namespace tessera {

// Chooses cells among the candidates, and one jittered point in each: all candidates in order if `uniform` is their
// number, otherwise `uniform` random ones followed by `occupied` random ones among those whose bit is set (up to 10
// tries each, then any). Entry p of this list draws from RandomStream(seed, 0x0cc) at index 16 p + purpose: purposes 0
// to 9 are the tries for a candidate (`below(index, candidates)`; a uniform entry takes the first), and 10, 11 and 12
// are the jitter in x, y and z (`uniform`). Position = (cell + jitter) / resolution, in float.
struct OccupancyPoints {
  const MarchSpace& space;
  uint32_t uniform = 0, occupied = 0;
  uint64_t seed = 0;                 // differs for every update
  Slice<const uint32_t> candidates;  // optional, cells; all cells if absent
  Slice<const uint32_t> occupancy;   // bits
  Slice<uint32_t> cells;             // [points], at most uniform + occupied - first
  Slice<float> positions;            // [points][3], grid coordinates
  uint32_t first = 0;                // the points are the entries [first, first + points) of the list
};
TESSERA_OPERATION(OccupancyPoints);

// Updates the grid and its bits. First every cell decays. Then grid = max(grid, exp(min(logDensity, 15)) · step) at the
// chosen cells (which may repeat), where step is the marching step there: clamp(cone · ‖x‖∞, minStep, maxStep) with x
// the cell centre in scene units; ‖x‖∞ = 1 / (2 - ‖y‖∞) if the contracted centre y has ‖y‖∞ > 1. (Contracted space
// fills only half of its grid: cells with two coordinates beyond 1 contain no point of the scene.) Cells with negative
// values are never visible and do not change. Finally bit = grid > min(threshold, mean over the cells that are not
// negative).
struct OccupancyUpdate {
  const MarchSpace& space;
  uint32_t points = 0;
  float decay = 0.95f;
  float threshold = 0.01f;
  Slice<const uint32_t> cells;     // [points]
  Matrix<const float> logDensity;  // [points], 1 column
  Slice<float> grid;               // [resolution³]
  Slice<uint32_t> occupancy;       // [resolution³ / 32]
};
TESSERA_OPERATION(OccupancyUpdate);

// Raises the grid to the opacities of samples on rays, so that cells that no ray reaches decay to empty: grid = max(grid,
// α) at the cell of each sample in front of which the ray's transmittance is above `minTransmittance`, where
// α = 1 / (1 + exp(-x - offset)). The cell of a position is floor(position · resolution) per axis, clamped to the grid.
// Cells with negative values do not change.
struct OccupancySamples {
  uint32_t resolution = 0;
  float offset = 0, minTransmittance = 0.01f;
  Count rays;
  Slice<const uint32_t> firstSample;  // [rays + 1]
  Matrix<const float> x;              // 1 column: logits
  Slice<const float> positions;       // [samples][3], grid coordinates in [0,1]
  Slice<float> grid;                  // [resolution³]
};
TESSERA_OPERATION(OccupancySamples);

}  // namespace tessera
