// Arranges the triangles that extraction keeps as patches of texels: two triangles with a common edge share a patch.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "compute/octahedra.h"
#include "scene/axes.h"

namespace tessera {

// Triangles with shared vertices, in the frame of a part.
struct TriangleList {
  std::vector<Vec3d> vertices;
  std::vector<std::array<uint32_t, 3>> triangles;  // indices of vertices
  std::vector<uint32_t> gridOfTriangle;
  std::vector<uint32_t> faceOfTriangle;  // numbers of faces (compute/octahedra.h)
};

// Returns those of the given faces (bits of face numbers, TraceOctahedra::keptFaces) that exist and whose bounds reach
// into the box of the grid of the same number in `owners`. Those of neighbouring parts overlap at their common wall by
// up to a triangle, so that there is no gap between their surfaces, which do not match exactly. displacements:
// [grids][cells][3].
TriangleList listTriangles(OctahedraGrids grids, OctahedraGrids owners, const std::vector<float>& displacements,
                           const std::vector<uint32_t>& faceBits);

// Corners in the order of MeshContent: (0, 1, 2) is the first triangle, (3, 2, 1) the second.
struct TrianglePatch {
  std::array<uint32_t, 4> corners{};    // indices of vertices; without a second triangle the last one is unused
  std::array<uint32_t, 2> triangles{};  // the first one, and the second one if there is one
  uint32_t grid = 0;
  bool isPair = false;
};

// Pairs triangles that share an edge, the flattest pairs first. Returns the pairs, then single triangles.
std::vector<TrianglePatch> pairTriangles(const TriangleList& list);

// Whether a texel of a patch is mixed into a place of one of its triangles.
inline bool isTexelUsed(bool isPair, uint32_t column, uint32_t row, uint32_t patchEdge) {
  return isPair || column + row <= patchEdge;
}

// Writes the position in the field, 3 numbers in [0, 1], of a point of the part's frame.
void toFieldPosition(const OctahedraGrid& grid, const Vec3d& point, float* position);

}  // namespace tessera
