// The parts of a mesh: its blocks, and what lies outside of all of them. Each is trained by itself, with a field,
// levels of detail and checkpoints of its own.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "compute/octahedra.h"
#include "scene/block_grid.h"
#include "train/scene_frame.h"

namespace tessera {

// In units of a part's frame. For a block, half its edge is 1; for what lies outside, half the longest edge of the
// region of all blocks.
struct MeshPart {
  std::string name;  // "block_0_0" (column, row), "background": its folder in the model's folder `parts`
  int block = -1;    // number in the grid of blocks; -1: the background block
  SceneFrame frame;
  std::array<float, 3> halfEdges{};  // of the block, or of the region that it lies outside of
  float halfBlockEdge = 1;           // for both kinds

  bool isBackground() const { return block < 0; }
};

// Returns the blocks of a grid, row by row, and the background block, if requested.
std::vector<MeshPart> makeMeshParts(const BlockGrid& grid, bool background);

// The octahedra of one level of detail of a part. Positions in its field are those of a lattice of cells that all grids
// share; an occupancy refers to the cells of this lattice.
struct OctahedraDomain {
  std::vector<OctahedraGrid> grids;  // for training
  // For rendering the model: limited to the block, so that no place is in two blocks. Outside, the grids do not
  // overlap.
  std::vector<OctahedraGrid> ownGrids;
  std::array<float, 3> boxInFront{};  // TraceOctahedra::boxInFront

  uint32_t latticeCells() const { return grids[0].positionCells > 0 ? grids[0].positionCells : grids[0].resolution; }
  // Returns the number of the cell of the lattice that contains a point of the part's frame, if faces can be hit there.
  std::optional<uint32_t> latticeCell(const Vec3d& point) const;
  // Returns a point in units of the lattice's cells in the part's frame: the inverse of the above. Points beyond the
  // regions that have faces are moved to their edges.
  Vec3d fromLattice(const Vec3d& inCells) const;
  // Returns the cells of all grids, [grids][words()], whose place in the lattice is set.
  std::vector<uint32_t> toGrids(const std::vector<uint32_t>& latticeBits) const;
};

// A block's grid reaches beyond its walls by a margin of this share of the grid's edge, so that the surfaces of coarse
// levels, which lack half a cell at the border, cover the block.
inline constexpr double kBlockMargin = 1.0 / 16;

// `cells`: along the edge of a block's grid, or of the region; even.
OctahedraDomain makeOctahedraDomain(const MeshPart& part, uint32_t cells, OctahedraPlacement placement);

}  // namespace tessera
