#include "compute/octahedra.h"

#include <algorithm>

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

}  // namespace tessera
