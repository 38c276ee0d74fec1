#include "representations/mesh/train/mesh_part.h"

#include <fmt/format.h>

#include <algorithm>

#include "scene/contraction.h"
#include "train/block_frame.h"

namespace tessera {

std::vector<MeshPart> makeMeshParts(const BlockGrid& grid, bool background) {
  const double height = (grid.top - grid.bottom) / 2;
  const SceneFrame whole = makeSceneFrame(grid);
  std::vector<MeshPart> parts;
  for (int cell = 0; cell < grid.cells(); ++cell) {
    MeshPart part;
    part.name = fmt::format("block_{}_{}", cell % grid.columns, cell / grid.columns);
    part.block = cell;
    part.frame = whole;
    const Vec2d centre = grid.centre(cell);
    part.frame.centre = grid.inWorld({centre.x(), centre.y(), (grid.bottom + grid.top) / 2});
    part.halfEdges = {1, 1, static_cast<float>(height * whole.scale)};
    parts.push_back(part);
  }
  if (!background) return parts;
  const Vec3d half = {grid.columns * grid.edge / 2, grid.rows * grid.edge / 2, height};
  MeshPart part;
  part.name = "background";
  part.frame = whole;
  part.frame.scale = 1 / half.maxCoeff();
  for (int axis = 0; axis < 3; ++axis) part.halfEdges[axis] = static_cast<float>(half[axis] * part.frame.scale);
  part.halfBlockEdge = static_cast<float>(grid.edge / 2 * part.frame.scale);
  parts.push_back(part);
  return parts;
}

std::optional<uint32_t> OctahedraDomain::latticeCell(const Vec3d& point) const {
  const uint32_t lattice = latticeCells();
  Triple<double> at;  // in cells of the lattice
  if (boxInFront[0] > 0) {
    Triple<double> x;
    for (int axis = 0; axis < 3; ++axis) x[axis] = point[axis] / boxInFront[axis];
    const int axis = farthestAxis(x);
    const double farthest = std::abs(x[axis]), halfCells = lattice / 4.0;
    if (farthest <= 1 || farthest >= halfCells / 2 || (axis == 2 && x[2] < 0)) return std::nullopt;
    x = contract(x);
    for (int a = 0; a < 3; ++a) at[a] = (x[a] + 2) * halfCells;
  } else {
    const OctahedraGrid& grid = grids[0];
    for (int axis = 0; axis < 3; ++axis) {
      const float* const m = grid.gridFromScene.data() + size_t{4} * axis;
      at[axis] = m[0] * point.x() + m[1] * point.y() + m[2] * point.z() + m[3];
      if (!(at[axis] >= grid.lowest[axis] && at[axis] < std::min<double>(lattice, grid.highest[axis])))
        return std::nullopt;
    }
  }
  uint32_t cell = 0;
  for (int axis = 2; axis >= 0; --axis) cell = cell * lattice + std::min(static_cast<uint32_t>(at[axis]), lattice - 1);
  return cell;
}

Vec3d OctahedraDomain::fromLattice(const Vec3d& inCells) const {
  Vec3d point;
  if (boxInFront[0] > 0) {
    constexpr double kFarthest = 2 - 1e-6;
    const double halfCells = latticeCells() / 4.0;
    Triple<double> x;
    for (int axis = 0; axis < 3; ++axis) x[axis] = std::clamp(inCells[axis] / halfCells - 2, -kFarthest, kFarthest);
    const int farthest = farthestAxis(x);
    for (int axis = 0; axis < 3; ++axis)
      if (axis != farthest) x[axis] = std::clamp(x[axis], -1.0, 1.0);
    x = uncontract(x);
    for (int axis = 0; axis < 3; ++axis) point[axis] = x[axis] * boxInFront[axis];
  } else {
    for (int axis = 0; axis < 3; ++axis) {
      const float* const m = grids[0].gridFromScene.data() + size_t{4} * axis;
      point[axis] = (inCells[axis] - m[3]) / m[axis];
    }
  }
  return point;
}

std::vector<uint32_t> OctahedraDomain::toGrids(const std::vector<uint32_t>& latticeBits) const {
  const uint32_t n = grids[0].resolution, words = grids[0].words();
  const int lattice = static_cast<int>(latticeCells());
  std::vector<uint32_t> bits(words * grids.size());
  for (size_t g = 0; g < grids.size(); ++g) {
    const auto& offset = grids[g].positionOffset;
    const int shift[3] = {static_cast<int>(offset[0]), static_cast<int>(offset[1]), static_cast<int>(offset[2])};
    uint32_t cell = 0;
    for (int k = shift[2]; k < shift[2] + static_cast<int>(n); ++k) {
      for (int j = shift[1]; j < shift[1] + static_cast<int>(n); ++j) {
        for (int i = shift[0]; i < shift[0] + static_cast<int>(n); ++i, ++cell) {
          if (std::min({i, j, k}) < 0 || std::max({i, j, k}) >= lattice) continue;
          const uint32_t at = static_cast<uint32_t>(i + lattice * (j + lattice * k));
          if ((latticeBits[at / 32] >> at % 32 & 1) != 0) bits[words * g + cell / 32] |= 1u << cell % 32;
        }
      }
    }
  }
  return bits;
}

OctahedraDomain makeOctahedraDomain(const MeshPart& part, uint32_t cells, OctahedraPlacement placement) {
  OctahedraDomain domain;
  if (part.isBackground()) {
    constexpr uint32_t kBelow = 5;  // what lies below the region is never seen
    for (uint32_t side = 0; side < kSides; ++side)
      if (side != kBelow) domain.grids.push_back(makeOutsideGrid(side, cells / 2, part.halfEdges, placement));
    domain.ownGrids = domain.grids;
    domain.boxInFront = part.halfEdges;
    return domain;
  }
  OctahedraGrid grid{cells, placement};
  const float half = 0.5f * static_cast<float>(cells), unit = half * static_cast<float>(1 - 2 * kBlockMargin);
  grid.gridFromScene = {unit, 0, 0, half, 0, unit, 0, half, 0, 0, unit, half, 0, 0, 0, 1};
  domain.grids = {grid};
  // Nothing is beside a block at its bottom.
  for (int axis = 0; axis < 3; ++axis) {
    if (axis < 2) grid.lowest[axis] = half - unit * part.halfEdges[axis];
    grid.highest[axis] = half + unit * part.halfEdges[axis];
  }
  domain.ownGrids = {grid};
  return domain;
}

}  // namespace tessera
