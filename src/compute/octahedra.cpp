#include "compute/octahedra.h"

#include <algorithm>

#include "base/check.h"

namespace tessera {

std::vector<ReachingFace> reachingFaces(OctahedraPlacement placement, uint32_t parity) {
  std::vector<ReachingFace> faces;
  for (int cell = 0; cell < 27; ++cell) {
    const std::array<int, 3> octahedron = {cell % 3 - 1, cell / 3 % 3 - 1, cell / 9 - 1};
    const int sum = octahedron[0] + octahedron[1] + octahedron[2] + 4;  // not negative, and of the same parity
    if (!carriesOctahedron(placement, static_cast<uint32_t>(sum) + parity, 0, 0)) continue;
    for (uint32_t local = 0; local < kFacesPerCell; ++local) {
      // A face lies in the box of the cells of its vertices, as a vertex never leaves its cell.
      bool reaches = true;
      const auto corners = octahedronFace(local);
      for (int axis = 0; axis < 3; ++axis) {
        const auto [low, high] = std::minmax({corners[0][axis], corners[1][axis], corners[2][axis]});
        reaches = reaches && octahedron[axis] + low <= 0 && octahedron[axis] + high >= 0;
      }
      if (reaches) faces.push_back({octahedron, local});
    }
  }
  return faces;
}

OctahedraGrid makeOutsideGrid(uint32_t side, uint32_t halfCells, const std::array<float, 3>& halfEdges,
                              OctahedraPlacement placement) {
  CHECK(side < kSides);
  CHECK(halfCells >= 4u);
  const uint32_t axis = side / 2;
  const bool negative = side % 2 == 1;
  const float half = static_cast<float>(halfCells);
  OctahedraGrid grid{2 * halfCells + 2, placement};
  grid.positionCells = 4 * halfCells;
  // Grid coordinates are h (2 + contracted) - offset. Along the axis, the contracted coordinate is ±2 - 1/x, and w is
  // the distance ±x; across, it is y / ±x.
  const float sign = negative ? -1.0f : 1.0f;
  grid.gridFromScene = {};
  for (uint32_t row = 0; row < 3; ++row) {
    float* const m = grid.gridFromScene.data() + size_t{4} * row;
    const bool along = row == axis;
    float offset = half - 1;
    if (along) offset = negative ? -half - 1 : 3 * half - 1;
    grid.positionOffset[row] = offset;
    grid.lowest[row] = 1;
    grid.highest[row] = 2 * half + 1;
    if (along) {
      m[axis] = ((negative ? 0.0f : 4 * half) - offset) * sign / halfEdges[axis];
      m[3] = negative ? half : -half;
      // The last two cells reach to infinity and beyond.
      (negative ? grid.lowest : grid.highest)[row] = negative ? half + 3 : half - 1;
    } else {
      m[row] = half / halfEdges[row];
      m[axis] = (2 * half - offset) * sign / halfEdges[axis];
    }
  }
  grid.gridFromScene[12 + axis] = sign / halfEdges[axis];
  return grid;
}

}  // namespace tessera
