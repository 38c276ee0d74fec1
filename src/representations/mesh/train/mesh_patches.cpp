#include "representations/mesh/train/mesh_patches.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "representations/mesh/train/face_set.h"

namespace tessera {
namespace {

using Mat4 = Eigen::Matrix4d;

Mat4 makeMatrix(const OctahedraGrid& grid) {
  Mat4 matrix;
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) matrix(row, column) = grid.gridFromScene[size_t{4} * row + column];
  return matrix;
}

}  // namespace

TriangleList listTriangles(OctahedraGrids grids, OctahedraGrids owners, const std::vector<float>& displacements,
                           const std::vector<uint32_t>& faceBits) {
  TriangleList list;
  const uint32_t n = grids[0].resolution, cells = grids[0].cells();
  std::unordered_map<uint32_t, uint32_t> vertexOfCell;  // by number of the cell in all grids
  for (uint32_t g = 0; g < grids.size(); ++g) {
    const Mat4 sceneFromGrid = makeMatrix(grids[g]).inverse();
    for (uint32_t local = 0; local < cells * kFacesPerCell; ++local) {
      const uint32_t face = g * cells * kFacesPerCell + local, cell = local / kFacesPerCell;
      if ((faceBits[face / 32] >> face % 32 & 1) == 0) continue;
      const int place[3] = {static_cast<int>(cell % n), static_cast<int>(cell / n % n),
                            static_cast<int>(cell / (n * n))};
      const auto corners = octahedronFace(local % kFacesPerCell);
      if (!faceExists(grids, face)) continue;
      std::array<uint32_t, 3> cellOfVertex{};
      std::array<Vec3d, 3> inGrid;
      for (int corner = 0; corner < 3; ++corner) {
        uint32_t number = 0;
        for (int axis = 2; axis >= 0; --axis)
          number = number * n + static_cast<uint32_t>(place[axis] + corners[corner][axis]);
        cellOfVertex[corner] = g * cells + number;
        for (int axis = 0; axis < 3; ++axis)
          inGrid[corner][axis] =
              place[axis] + corners[corner][axis] + 0.5 + displacements[size_t{3} * cellOfVertex[corner] + axis];
      }
      bool isOwn = true;
      for (int axis = 0; axis < 3; ++axis) {
        const auto [low, high] = std::minmax({inGrid[0][axis], inGrid[1][axis], inGrid[2][axis]});
        isOwn = isOwn && high > owners[g].lowest[axis] && low < owners[g].highest[axis];
      }
      if (!isOwn) continue;
      std::array<uint32_t, 3> triangle{};
      for (int corner = 0; corner < 3; ++corner) {
        const auto [entry, isNew] =
            vertexOfCell.emplace(cellOfVertex[corner], static_cast<uint32_t>(list.vertices.size()));
        if (isNew) list.vertices.push_back((sceneFromGrid * inGrid[corner].homogeneous()).hnormalized());
        triangle[corner] = entry->second;
      }
      list.triangles.push_back(triangle);
      list.gridOfTriangle.push_back(g);
      list.faceOfTriangle.push_back(face);
    }
  }
  return list;
}

std::vector<TrianglePatch> pairTriangles(const TriangleList& list) {
  // Triangles by edge.
  struct Side {
    uint64_t edge;
    uint32_t triangle, apex;  // apex: the corner that is not on the edge
    bool operator<(const Side& other) const {
      return edge != other.edge ? edge < other.edge : triangle < other.triangle;
    }
  };
  const uint32_t count = static_cast<uint32_t>(list.triangles.size());
  std::vector<Side> sides;
  for (uint32_t triangle = 0; triangle < count; ++triangle) {
    for (uint32_t apex = 0; apex < 3; ++apex) {
      const auto& t = list.triangles[triangle];
      const uint32_t p = t[(apex + 1) % 3], q = t[(apex + 2) % 3];
      sides.push_back({uint64_t{std::min(p, q)} << 32 | std::max(p, q), triangle, apex});
    }
  }
  std::sort(sides.begin(), sides.end());
  struct Candidate {
    double flatness;
    uint32_t first, second;  // sides
  };
  std::vector<Candidate> candidates;
  for (size_t begin = 0; begin < sides.size();) {
    size_t end = begin;
    while (end < sides.size() && sides[end].edge == sides[begin].edge) ++end;
    for (size_t i = begin; i < end; ++i)
      for (size_t j = i + 1; j < end; ++j) {
        // Two triangles that lie on each other, on the same side of the edge, are not flat.
        const auto beyond = [&](size_t side) {
          const auto& t = list.triangles[sides[side].triangle];
          const Vec3d& p = list.vertices[t[(sides[side].apex + 1) % 3]];
          const Vec3d edge = (list.vertices[t[(sides[side].apex + 2) % 3]] - p).normalized();
          const Vec3d aside = list.vertices[t[sides[side].apex]] - p;
          return Vec3d((aside - aside.dot(edge) * edge).normalized());
        };
        candidates.push_back({-beyond(i).dot(beyond(j)), static_cast<uint32_t>(i), static_cast<uint32_t>(j)});
      }
    begin = end;
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.flatness > b.flatness; });
  std::vector<bool> isTaken(count);
  std::vector<TrianglePatch> patches;
  for (const Candidate& candidate : candidates) {
    const Side &a = sides[candidate.first], &b = sides[candidate.second];
    if (isTaken[a.triangle] || isTaken[b.triangle]) continue;
    isTaken[a.triangle] = isTaken[b.triangle] = true;
    const auto& t = list.triangles[a.triangle];
    TrianglePatch patch;
    patch.corners = {t[a.apex], t[(a.apex + 1) % 3], t[(a.apex + 2) % 3], list.triangles[b.triangle][b.apex]};
    patch.triangles = {a.triangle, b.triangle};
    patch.grid = list.gridOfTriangle[a.triangle];
    patch.isPair = true;
    patches.push_back(patch);
  }
  for (uint32_t triangle = 0; triangle < count; ++triangle) {
    if (isTaken[triangle]) continue;
    const auto& t = list.triangles[triangle];
    patches.push_back({{t[0], t[1], t[2], t[0]}, {triangle, triangle}, list.gridOfTriangle[triangle], false});
  }
  return patches;
}

void toFieldPosition(const OctahedraGrid& grid, const Vec3d& point, float* position) {
  double g[4];
  for (size_t row = 0; row < 4; ++row) {
    const float* const m = grid.gridFromScene.data() + 4 * row;
    g[row] = double{m[0]} * point.x() + double{m[1]} * point.y() + double{m[2]} * point.z() + m[3];
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double at = (g[axis] / g[3] + grid.positionOffset[axis]) * grid.positionScale();
    position[axis] = static_cast<float>(std::clamp(at, 0.0, 1.0));
  }
}

}  // namespace tessera
