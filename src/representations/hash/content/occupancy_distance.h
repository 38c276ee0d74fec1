// How far nothing is, for rays of each octant of directions: what stands here for NGP-RT's occupancy distance grid
// (section 4.3, eq. 9).
#pragma once

#include <cstdint>
#include <vector>

#include "raymarch/content/occupancy_pyramid.h"

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

// The same in two grids: far away by cells that are a few of the finest ones wide, near what is occupied by the finest
// ones themselves.
struct OctantDistances {
  static constexpr uint32_t kMostCoarse = 128;  // cells along an edge, unless kMostRatio makes more
  static constexpr uint32_t kMostRatio = 4;
  static uint32_t ratioFor(uint32_t finestCells);

  uint32_t ratio = 1;  // finest cells along an edge of a coarse one: 1, 2 or 4
  uint32_t cells = 0;  // coarse ones along an edge
  // [cells³], x fastest. Of empty cells octantDistances. Of one that holds something the lowest four bits are 0, and
  // the others its number among such (0 where ratio is 1).
  std::vector<uint32_t> coarse;
  // Where ratio is above 1, of each such cell its [ratio³] finest ones, x fastest: octantDistances in finest cells, or
  // less where the next cells' are not known to be more. All of the word is 0 where the cell is occupied.
  std::vector<uint32_t> fine;

  bool operator==(const OctantDistances&) const = default;
  static bool isEmpty(uint32_t coarseWord) { return (coarseWord & 15) != 0; }
  size_t nearCells() const { return fine.size() / (size_t{ratio} * ratio * ratio); }  // that are in `fine`
};

// Of the pyramid's finest level, whose cells along an edge are a multiple of 4 or at most kMostCoarse.
OctantDistances octantDistances(const OccupancyPyramid& occupied);
// How many cells of the coarse grid hold something, where ratio is above 1; else 0.
size_t nearCellsOf(const OccupancyPyramid& occupied);

// Occupied ones and their 26 neighbours.
OccupancyBits dilated(const OccupancyBits& occupied);

}  // namespace tessera
