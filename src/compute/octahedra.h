// Grids of movable octahedra (Gu et al. 2023, UE4-NeRF, section 3.1.2): the triangles of `mesh`, the hits of rays on
// them, and the gradient of hits with respect to the vertices.
//
// A grid has N³ cells with one vertex each, which moves within its cell. Grid coordinates are in units of cells: cell
// (i, j, k) fills [i, i+1] × [j, j+1] × [k, k+1], and its vertex lies at (i, j, k) + 0.5 + displacement, with each
// component of the displacement between -0.5 and 0.5, both excluded: faces in the wall between two cells would belong
// to neither. The octahedron of a cell has the vertices of the six cells beside it as corners and the cell's own vertex
// as centre. It has 20 faces: 8 outer ones, and 12 inner ones, each of which joins the centre with an edge. A face with
// a vertex outside the grid does not exist.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "compute/memory.h"
#include "compute/operation.h"

namespace tessera {

// Which cells carry an octahedron: those with an even i + j + k, so that octahedra and the tetrahedra between them fill
// space, or all of them, so that faces overlap in space (each square between four cells is covered twice).
enum class OctahedraPlacement { checkerboard, all };

inline constexpr float kMaxDisplacement = 0.499f;  // to which training limits displacements

struct OctahedraGrid {
  uint32_t resolution = 128;  // N, at most 512
  OctahedraPlacement placement = OctahedraPlacement::checkerboard;
  // Maps homogeneous positions (x, y, z, 1) of the scene to homogeneous grid coordinates; row-major. A projective
  // matrix maps lines to lines and planes to planes, so that triangles are flat in the scene, too. The scene points
  // that it maps into the grid must have a positive last coordinate.
  std::array<float, 16> gridFromScene = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  // The box of grid coordinates in which faces are hit; beyond it they only complete the surfaces in the box.
  std::array<float, 3> lowest = {0, 0, 0}, highest = {512, 512, 512};  // limited to the grid
  // The positions of hits are (grid coordinates + positionOffset) · positionScale(), so that several grids can share
  // one encoding.
  std::array<float, 3> positionOffset = {0, 0, 0};
  uint32_t positionCells = 0;  // 0: resolution

  float positionScale() const { return 1.0f / static_cast<float>(positionCells > 0 ? positionCells : resolution); }
  uint32_t cells() const { return resolution * resolution * resolution; }
  // Bits of cells are those of MarchRays::occupancy: cell (i, j, k) at i + N (j + N k).
  uint32_t words() const { return (cells() + 31) / 32; }
};

// Faces are numbered 20 · cell + local. Local numbers 0 to 7 are the outer faces: bit a is set if the corner along axis
// a is on the negative side. Inner faces have the numbers 8 + 4 · pair + 2 · [s < 0] + [t < 0] with the pairs of axes
// (x, y), (x, z), (y, z) and the sides s and t of the corners along the first and the second axis.
inline constexpr uint32_t kFacesPerCell = 20, kOuterFaces = 8;

// Returns the cells of the three vertices of a face, relative to the cell of the octahedron. Outer faces: the corners
// along x, y and z. Inner faces: the centre, then the corners along the first and the second axis.
constexpr std::array<std::array<int, 3>, 3> octahedronFace(uint32_t local) {
  std::array<std::array<int, 3>, 3> corners{};
  if (local < kOuterFaces) {
    for (uint32_t axis = 0; axis < 3; ++axis) corners[axis][axis] = (local >> axis & 1) ? -1 : 1;
    return corners;
  }
  const uint32_t pair = (local - kOuterFaces) / 4, signs = (local - kOuterFaces) % 4;
  corners[1][pair == 2 ? 1 : 0] = (signs & 2) ? -1 : 1;
  corners[2][pair == 0 ? 1 : 2] = (signs & 1) ? -1 : 1;
  return corners;
}

inline bool carriesOctahedron(OctahedraPlacement placement, uint32_t i, uint32_t j, uint32_t k) {
  return placement == OctahedraPlacement::all || (i + j + k) % 2 == 0;
}

// A face that can reach into a cell: a point of the face in that cell exists for some displacements.
struct ReachingFace {
  std::array<int, 3> octahedron;  // its cell, relative to the cell that the face reaches into
  uint32_t local;
};

// Returns the faces that can reach into a cell with the given parity of i + j + k: 56, or 112 with octahedra in all
// cells. Their vertices lie in the 27 cells around it.
std::vector<ReachingFace> reachingFaces(OctahedraPlacement placement, uint32_t parity);

// Several grids with the same resolution and placement, whose boxes do not overlap in the scene. Cell c of grid g is
// number g · cells() + c, also in the numbers of faces; the bits of its occupancy start at word g · words().
using OctahedraGrids = std::span<const OctahedraGrid>;
inline constexpr uint32_t kMaxOctahedraGrids = 6;
// Words of the bits of all faces, least significant first.
inline uint32_t faceWords(OctahedraGrids grids) {
  return grids.empty() ? 0 : (kFacesPerCell * grids[0].cells() * static_cast<uint32_t>(grids.size()) + 31) / 32;
}

// The sides of a box around the origin of the scene, to which makeOutsideGrid refers: +x, -x, +y, -y, +z, -z.
inline constexpr uint32_t kSides = 6;

// Returns the grid of what lies beyond one side of a box with these half edges, seen from its centre: of the points
// whose coordinate along the side's axis is the largest, in units of half edges. Its cells are cubes in the contracted
// space of MERF (MarchSpace) of these units, with 2 · halfCells cells along an edge of the box; halfCells is at
// least 4. Faces are hit up to the distance halfCells / 2 from the centre. The grid extends beyond the side's edges,
// and into the box, by one cell, whose faces complete the surfaces there. Positions are (contracted + 2) / 4, so that
// the grids of all sides share an encoding.
OctahedraGrid makeOutsideGrid(uint32_t side, uint32_t halfCells, const std::array<float, 3>& halfEdges,
                              OctahedraPlacement placement);

// Finds the hits of rays with the faces of grids, in the order of their distance along the ray (equal distances: of
// their face numbers). A hit exists if its distance is in (near, farOfRay), and its position in an occupied cell and in
// the box of its grid. A ray within the plane of a face does not hit it. A ray keeps its nearest `maximum` hits, and
// the nearest 64 in each cell. Rays are completed in order as long as their hits fit; the first ray that would exceed
// `sampleCapacity` gets no hits, and neither do the rays after it.
struct TraceOctahedra {
  OctahedraGrids grids;
  Count rays;
  uint32_t sampleCapacity = 0;
  uint32_t maximum = 0xffffffffu;  // hits per ray
  float near = 0;
  // If positive: half the edges of a box around the origin of the scene. A ray that crosses it has hits behind it only.
  std::array<float, 3> boxInFront = {0, 0, 0};
  Slice<const float> origins;        // [rays][3], in the scene
  Slice<const float> directions;     // [rays][3]; zero: the ray has no hits
  Slice<const float> farOfRay;       // optional, [rays]
  Slice<const float> displacements;  // [grids][cells][3]
  Slice<const uint32_t> occupancy;   // bits, [grids][words()]
  Slice<const uint32_t> keptFaces;   // optional, bits, [faceWords(grids)]: only these faces are hit
  Slice<uint32_t> firstSample;       // [rays + 1]: hits of ray r are [firstSample[r], firstSample[r+1])
  Slice<uint32_t> sampleCount;       // [1]: total number of hits
  Slice<uint32_t> finishedRays;      // optional, [1]: number of rays that fit
  Slice<uint32_t> rayOfSample;       // optional, [sampleCapacity]
  Slice<uint32_t> faces;             // [sampleCapacity]
  Slice<float> barycentrics;         // [sampleCapacity][2], of the second and third vertex, in grid coordinates
  Slice<float> positions;            // [sampleCapacity][3], in [0,1]
  Slice<float> distances;            // [sampleCapacity], in multiples of the direction's length
};
TESSERA_OPERATION(TraceOctahedra);

// The gradient of the hits of TraceOctahedra with respect to the displacements of the vertices. A face's plane moves a
// hit along the ray only: with g(t) the ray in grid coordinates, n the face's normal and λ the barycentric coordinates,
// ∂t/∂v_i = λ_i n / (n · g'(t)) and ∂g/∂v_i = g'(t) ∂t/∂v_i. Hits that appear or disappear at the border of a face have
// no gradient. Steep planes would move hits arbitrarily far: |n · g'| is taken as at least minCosine |n| |g'|, which is
// no longer the gradient of the loss. Adds to `displacementGradients`.
struct OctahedraBackward {
  OctahedraGrids grids;
  Count samples;
  float minCosine = 0.1f;
  Slice<const float> origins;            // [rays][3]
  Slice<const float> directions;         // [rays][3]
  Slice<const float> displacements;      // [grids][cells][3]
  Slice<const uint32_t> rayOfSample;     // [capacity]
  Slice<const uint32_t> faces;           // [capacity]
  Slice<const float> barycentrics;       // [capacity][2]
  Slice<const float> distances;          // [capacity]
  Slice<const float> positionGradients;  // [capacity][3], with respect to TraceOctahedra::positions
  Slice<const float> distanceGradients;  // optional, [capacity]
  Slice<float> displacementGradients;    // [grids][cells][3]
};
TESSERA_OPERATION(OctahedraBackward);

// Makes the grid of the next coarser level of detail (section 3.1.2), whose cells are twice as wide: each takes the
// vertex of the most opaque of its eight children, the first of equal ones. The opacity of a child is the mean over
// points in it, each 1 / (1 + exp(-x - offset)); that of cells that are not listed is 0. A cell whose children are all
// less opaque than kTransparent gets the displacement 0.
struct MergeOctahedra {
  static constexpr float kTransparent = 1e-3f;

  uint32_t resolution = 0;  // N of the finer grid, even
  uint32_t points = 1;      // per cell
  float offset = 0;
  Slice<const uint32_t> cells;  // [cells listed], of the finer grid, distinct
  Matrix<const float> x;        // [points · cells listed], 1 column: logits; row p · cells listed + i is of cells[i]
  Slice<const float> displacements;  // [N³][3]
  Slice<float> opacities;            // [N³], overwritten
  Slice<float> mergedDisplacements;  // [(N/2)³][3], overwritten
};
TESSERA_OPERATION(MergeOctahedra);

}  // namespace tessera
