// Distances through empty space, for rays of each octant of directions. They replace NGP-RT's occupancy distance grid
// (section 4.3, eq. 9).
#pragma once

#include <cstdint>
#include <vector>

#include "raymarch/content/occupancy_pyramid.h"

namespace tessera {

// Returns one word for each cell: [cells³], x fastest. For each octant o of directions (bit a of o is set if the
// direction points upwards along axis a), the four bits from bit 4 o on hold k, the number of cells along an edge of
// the largest empty cube that begins at the cell and extends into that octant: a ray of that octant from anywhere in
// the cell meets no occupied cell before it leaves the cube. k is at most 15, and 0 in occupied cells. Space beyond the
// grid counts as empty.
//
// The paper's grid stores the distance to the nearest occupied cell in any direction, which lets a ray that moves away
// from a wall skip little. The cube of a ray's own octant contains all of that ball that the ray can pass through.
//
// k is one more than the minimum over the seven next cells: dynamic programming, with one sweep for each octant.
std::vector<uint32_t> octantDistances(const OccupancyBits& occupied);
inline constexpr uint32_t kFarthestOctantDistance = 15;

inline uint32_t octantDistance(uint32_t word, uint32_t octant) {
  return word >> (4 * octant) & 15;
}

// The same distances in two grids: in coarse cells, each a few of the finest cells wide, where these are empty, and in
// the finest cells near occupied space.
struct OctantDistanceField {
  static constexpr uint32_t kMaxCoarse = 128;  // coarse cells along an edge; more where kMaxRatio limits the ratio
  static constexpr uint32_t kMaxRatio = 4;
  static uint32_t ratioFor(uint32_t finestCells);

  uint32_t ratio = 1;  // finest cells along an edge of a coarse one: 1, 2 or 4
  uint32_t cells = 0;  // coarse cells along an edge
  // [cells³], x fastest. The word of an empty cell is as in octantDistances. In the word of a cell that is not empty, a
  // near cell, the lowest four bits are 0 and the others are its index among the near cells (0 where ratio is 1).
  std::vector<uint32_t> coarse;
  // Where ratio is above 1: the [ratio³] finest cells of each near cell, x fastest. Their words are as in
  // octantDistances, in finest cells, or have smaller distances where those of the next cells are not known to be
  // larger. The whole word is 0 where the finest cell is occupied.
  std::vector<uint32_t> fine;

  bool operator==(const OctantDistanceField&) const = default;
  static bool isEmpty(uint32_t coarseWord) { return (coarseWord & 15) != 0; }
  size_t nearCells() const { return fine.size() / (size_t{ratio} * ratio * ratio); }  // cells that `fine` holds
};

// Returns the distances for the pyramid's finest level, whose number of cells along an edge is a multiple of 4 or at
// most kMaxCoarse.
OctantDistanceField octantDistances(const OccupancyPyramid& occupied);
// Returns the number of coarse cells that are not empty if the ratio is above 1, and 0 otherwise.
size_t countNearCells(const OccupancyPyramid& occupied);

// Returns the occupied cells together with their 26 neighbours.
OccupancyBits dilated(const OccupancyBits& occupied);

}  // namespace tessera
