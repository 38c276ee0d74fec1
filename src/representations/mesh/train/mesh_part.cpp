#include "representations/mesh/train/mesh_part.h"

#include <fmt/format.h>

#include <algorithm>

#include "scene/contraction.h"
#include "train/block_frame.h"

namespace tessera {

std::vector<MeshPart> makeMeshParts(const BlockGrid& grid, bool outside) {
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
  if (!outside) return parts;
  const Vec3d half = {grid.columns * grid.edge / 2, grid.rows * grid.edge / 2, height};
  MeshPart part;
  part.name = "background";
  part.frame = whole;
  part.frame.scale = 1 / half.maxCoeff();
  for (int axis = 0; axis < 3; ++axis) part.halfEdges[axis] = static_cast<float>(half[axis] * part.frame.scale);
  parts.push_back(part);
  return parts;
}

std::optional<uint32_t> OctahedraDomain::latticeCell(const Vec3d& point) const {
  const uint32_t lattice = latticeCells();
  for (const OctahedraGrid& grid : grids) {
    double g[4];
    for (size_t row = 0; row < 4; ++row) {
      const float* const m = grid.gridFromScene.data() + 4 * row;
      g[row] = m[3];
      for (int column = 0; column < 3; ++column) g[row] += double{m[column]} * point[column];
    }
    if (g[3] <= 0) continue;
    bool inside = true;
    uint32_t cell = 0;
    for (int axis = 2; axis >= 0; --axis) {
      const double at = g[axis] / g[3];
      inside = inside && at >= grid.lowest[axis] && at < std::min<double>(grid.resolution, grid.highest[axis]);
      cell = cell * lattice + static_cast<uint32_t>(std::max(0.0, at + grid.positionOffset[axis]));
    }
    if (inside) return cell;
  }
  return std::nullopt;
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
