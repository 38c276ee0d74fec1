// How far nothing is, as a ray of any direction needs it: NGP-RT's occupancy distance grid (section 4.3, eq. 9).
#pragma once

#include <cstdint>
#include <vector>

#include "tiles/occupancy_pyramid.h"

namespace tessera {

// [cells³], x fastest, in edges of a cell: from any place in a cell one may go so far in any direction without coming
// into an occupied one. That is the distance between the boxes of the two cells, sqrt(Σ_a max(|c_a - o_a| - 1, 0)²) for
// the nearest o, rounded down; at most 255, which also stands where nothing is occupied. 0 in occupied cells and beside
// them.
//
// It is the distance between the middles of cells, rounded down, after occupied ones have been made to reach one cell
// further in all 26 directions; that in turn is exact: three passes of lower envelopes (Felzenszwalb and Huttenlocher,
// "Distance transforms of sampled functions", 2012) over whole numbers.
std::vector<uint8_t> occupancyDistances(const OccupancyBits& occupied);

// The paper's, between the middles of cells: up to √3 too far, so that what is occupied may be passed over. For
// comparison.
std::vector<uint8_t> naiveOccupancyDistances(const OccupancyBits& occupied);

// Occupied ones and their 26 neighbours.
OccupancyBits dilated(const OccupancyBits& occupied);

}  // namespace tessera
