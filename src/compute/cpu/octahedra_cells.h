// What TraceOctahedra on the CPU looks up for cells: which of them are occupied, and the faces that can reach into one.
#pragma once

#include <bit>
#include <cstdint>
#include <limits>
#include <vector>

#include "compute/octahedra.h"

namespace tessera::cpu {

// The occupied cells of each block of 4³ cells as a bit mask, so that rays cross empty blocks at once.
class OccupiedBlocks {
 public:
  static constexpr uint32_t kEdge = 4;

  OccupiedBlocks(OctahedraGrids grids, const uint32_t* occupancy)
      : blocks_((grids[0].resolution + kEdge - 1) / kEdge), masks_(size_t{blocksInGrid()} * grids.size()) {
    const uint32_t n = grids[0].resolution, words = grids[0].words();
    // Bits of a group lie in one block, one after another along x.
    const uint32_t group = n % kEdge == 0 ? kEdge : 1, groupBits = (1u << group) - 1;
    for (size_t word = 0; word < words * grids.size(); ++word) {
      for (uint32_t bits = occupancy[word]; bits != 0;) {
        const uint32_t first = static_cast<uint32_t>(std::countr_zero(bits)) / group * group;
        const uint32_t cell = static_cast<uint32_t>(word % words) * 32 + first;
        const uint32_t at[3] = {cell % n, cell / n % n, cell / (n * n)};
        const size_t block = at[0] / kEdge + blocks_ * (at[1] / kEdge + size_t{blocks_} * (at[2] / kEdge));
        masks_[word / words * blocksInGrid() + block] |=
            uint64_t{bits >> first & groupBits} << (at[0] % kEdge + 4 * (at[1] % kEdge) + 16 * (at[2] % kEdge));
        bits &= ~(groupBits << first);
      }
    }
  }
  // Block (i, j, k) of grid g at g · blocksInGrid() + i + blocks() (j + blocks() k); in a mask, cell (i, j, k) of the
  // block is bit i + 4 j + 16 k.
  const uint64_t* masks() const { return masks_.data(); }
  uint32_t blocks() const { return blocks_; }
  uint32_t blocksInGrid() const { return blocks_ * blocks_ * blocks_; }

 private:
  uint32_t blocks_;
  std::vector<uint64_t> masks_;
};

// The vertices of the 27 cells around a cell are in two vectors of 16 slots. Those of the cells below, level with, and
// above the middle one along z are each in the order of x, then y, and fill the slots from 0, from 16, and the rest.
inline constexpr int kSlots = 32, kEmptySlot = 27;
constexpr int slotOfVertex(int x, int y, int z) {  // coordinates relative to the middle cell, -1 to 1
  const int place = x + 1 + 3 * (y + 1);
  if (z < 0) return place;
  if (z == 0) return 16 + place;
  return place < 7 ? 9 + place : 18 + place;
}

// The cell of each slot's vertex relative to the middle one; slots without a vertex hold NaN.
struct SlotOffsets {
  alignas(64) float at[3][kSlots] = {};

  constexpr SlotOffsets() {
    for (auto& row : at)
      for (float& offset : row) offset = std::numeric_limits<float>::quiet_NaN();
    for (int z = -1; z <= 1; ++z) {
      for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
          const int slot = slotOfVertex(x, y, z);
          at[0][slot] = static_cast<float>(x);
          at[1][slot] = static_cast<float>(y);
          at[2][slot] = static_cast<float>(z);
        }
      }
    }
  }
};
inline constexpr SlotOffsets kSlotOffsets;

// The faces that can reach into a cell.
struct Candidates {
  static constexpr int kMax = 112;
  static constexpr int kNumberShift = 24;

  int count = 0;  // a multiple of 16; those of no face have empty slots
  // The slots of a candidate's three vertices in its lowest three bytes, and its number in the highest.
  alignas(64) int32_t packed[kMax] = {};
  uint32_t face[kMax] = {};  // its number less that of the first face of the middle cell, modulo 2³²

  Candidates(OctahedraPlacement placement, uint32_t parity, uint32_t resolution) {
    for (const ReachingFace& reaching : reachingFaces(placement, parity)) {
      const auto corners = octahedronFace(reaching.local);
      const std::array<int, 3>& cell = reaching.octahedron;
      int32_t all = count << kNumberShift;
      for (int corner = 0; corner < 3; ++corner)
        all |= slotOfVertex(cell[0] + corners[corner][0], cell[1] + corners[corner][1], cell[2] + corners[corner][2])
               << 8 * corner;
      const int n = static_cast<int>(resolution);
      face[count] = kFacesPerCell * static_cast<uint32_t>(cell[0] + n * (cell[1] + n * cell[2])) + reaching.local;
      packed[count++] = all;
    }
    for (; count % 16 != 0; ++count) packed[count] = kEmptySlot * 0x010101 | count << kNumberShift;
  }
};

}  // namespace tessera::cpu
