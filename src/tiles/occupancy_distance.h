// How far nothing is, for rays of each octant of directions: what stands here for NGP-RT's occupancy distance grid
// (section 4.3, eq. 9).
#pragma once

#include <cstdint>
#include <vector>

#include "tiles/occupancy_pyramid.h"

namespace tessera {

// [cells³], x fastest. Of each octant o of directions (bit a of o: along axis a upwards), the four bits from 4 o on are
// the number k of cells along an edge of the largest empty cube that begins at the cell and lies in that direction: a
// ray from anywhere in the cell meets nothing before it leaves the cube. At most 15; 0 in occupied cells. What lies
// beyond the grid counts as empty.
//
// The paper's grid says how far nothing is in whichever direction, and so little to a ray that moves away from a wall.
// The cube of its own octant holds all of the ball that the ray may pass through.
//
// k is one more than the least of the seven next cells': dynamic programming, one sweep for each octant.
std::vector<uint32_t> octantDistances(const OccupancyBits& occupied);
inline constexpr uint32_t kFarthestOctantDistance = 15;

inline uint32_t octantDistance(uint32_t word, uint32_t octant) {
  return word >> (4 * octant) & 15;
}

// Occupied ones and their 26 neighbours.
OccupancyBits dilated(const OccupancyBits& occupied);

}  // namespace tessera
