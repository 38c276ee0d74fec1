// What trace_octahedra.cpp and its parts for each SIMD target share.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "compute/cpu/octahedra_cells.h"
#include "compute/cpu/octahedra_rays.h"
#include "compute/host_memory.h"
#include "compute/octahedra.h"

namespace tessera::cpu {

inline constexpr size_t kCellsAtATime = 8;           // of a ray, that are tested
inline constexpr size_t kMaxHitsInCell = 64;         // the nearest stay
inline constexpr uint32_t kMaxLanes = 8;             // of vectors of double
inline constexpr uint32_t kMaxRays = 2 * kMaxLanes;  // walk at a time

// What all rays of an operation share.
struct TracedOctahedra {
  const TraceOctahedra& a;
  OccupiedBlocks blocks;
  Candidates even, odd;  // by the parity of the sum of a cell's coordinates

  explicit TracedOctahedra(const TraceOctahedra& all)
      : a(all),
        blocks(all.grids, hostPointer(all.occupancy)),
        even(all.grids[0].placement, 0, all.grids[0].resolution),
        odd(all.grids[0].placement, 1, all.grids[0].resolution) {}
};

// A ray in one of the grids that it crosses: g = entry + s · step for s in [0, last], where the farthest coordinate
// advances by 1 per unit of s.
struct Crossing {
  HomogeneousRay line;
  uint32_t ray, grid;
  double near, far;  // distances
  double entry[3], step[3], last;
  int cell[3];  // the first one
  int z = 0;    // the axis along which the ray is longest

  Crossing(const TraceOctahedra& a, uint32_t rayNumber, uint32_t gridNumber, double nearest, double farthest)
      : line(a.grids[gridNumber], hostPointer(a.origins) + 3 * size_t{rayNumber},
             hostPointer(a.directions) + 3 * size_t{rayNumber}),
        ray(rayNumber),
        grid(gridNumber),
        near(nearest),
        far(farthest) {
    line.clip(a.grids[grid], &near, &far);
  }

  bool meetsGrid() const { return near < far; }
  // Sets what the walk needs; false if the ray has no direction in the grid.
  bool enter(int resolution) {
    double direction[3], largest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      direction[axis] = line.slope[axis] * line.start[3] - line.start[axis] * line.slope[3];
      if (std::abs(direction[axis]) > largest) {
        largest = std::abs(direction[axis]);
        z = axis;
      }
    }
    if (!(largest > 0)) return false;
    const double scale = 1 / (line.start[3] + near * line.slope[3]);
    for (int axis = 0; axis < 3; ++axis) {
      step[axis] = direction[axis] / largest;
      entry[axis] =
          std::clamp((line.start[axis] + near * line.slope[axis]) * scale, 0.0, static_cast<double>(resolution));
      cell[axis] = std::min(static_cast<int>(entry[axis]), resolution - 1);
      // On a wall between two cells, the ray is in the one that it enters.
      if (step[axis] < 0 && cell[axis] > 0 && entry[axis] == cell[axis]) --cell[axis];
    }
    last = std::abs(line.at(far, z) - entry[z]);
    return true;
  }
};

// An occupied cell that a ray crosses from s = enter to leave.
struct CrossedCell {
  double enter, leave;
  int cell[3];
};

// Hits of a ray that are not yet in TaskHits; those of a cell are sorted.
struct PendingHits {
  struct Face {
    uint32_t face;
    float barycentrics[2];
  };
  static constexpr size_t kEnough = 64;  // are then moved to TaskHits
  static constexpr size_t kMax = kEnough + kMaxHitsInCell;

  alignas(64) double s[kMax + kMaxLanes];
  Face faces[kMax];
  size_t count = 0;
};

// The hits of some successive rays, as the operation returns them.
class TaskHits {
 public:
  size_t count() const { return count_; }
  void makeRoomFor(size_t more) {
    if (count_ + more <= faces.size()) return;
    const size_t size = 2 * (count_ + more);
    faces.resize(size);
    barycentrics.resize(2 * size);
    positions.resize(3 * size);
    distances.resize(size);
  }
  void add() { ++count_; }
  void clear() { count_ = 0; }

  std::vector<uint32_t> faces;
  std::vector<float> barycentrics, positions, distances;

 private:
  size_t count_ = 0;
};

// What a thread needs while it traces.
struct TraceScratch {
  std::vector<Crossing> crossings;
  std::unique_ptr<CrossedCell[]> cells;  // [kMaxRays][cellsOfRay]
  size_t cellsOfRay = 0, cellCounts[kMaxRays] = {};
  PendingHits pending;

  void makeRoomFor(uint32_t resolution) {
    // Coordinates change in one direction only, but for those that repeat by rounding.
    const size_t most = 3 * size_t{resolution} + 8;
    if (most <= cellsOfRay) return;
    cellsOfRay = most;
    cells.reset(new CrossedCell[kMaxRays * cellsOfRay]);
  }
};

}  // namespace tessera::cpu
