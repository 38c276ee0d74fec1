// Gradients of the hits on octahedra, and coarser grids, on the CPU. trace_octahedra.cpp finds the hits.

#include "compute/octahedra.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "compute/cpu/kernels.h"
#include "compute/cpu/octahedra_rays.h"
#include "compute/host_memory.h"

namespace tessera::cpu {
namespace {

// A face's vertices, and where they lie in their grid.
struct FaceVertices {
  uint32_t cell[3];
  double at[3][3];

  FaceVertices(const OctahedraGrid& grid, const float* displacements, uint32_t face) {
    const uint32_t n = grid.resolution, cells = grid.cells(), firstCell = face / kFacesPerCell / cells * cells;
    const uint32_t octahedron = face / kFacesPerCell - firstCell;
    const int centre[3] = {static_cast<int>(octahedron % n), static_cast<int>(octahedron / n % n),
                           static_cast<int>(octahedron / (n * n))};
    const auto corners = octahedronFace(face % kFacesPerCell);
    for (int corner = 0; corner < 3; ++corner) {
      uint32_t stride = 1;
      cell[corner] = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const int place = centre[axis] + corners[corner][axis];
        at[corner][axis] = place + 0.5;
        cell[corner] += stride * static_cast<uint32_t>(place);
        stride *= n;
      }
      cell[corner] += firstCell;
      for (int axis = 0; axis < 3; ++axis) at[corner][axis] += displacements[3 * size_t{cell[corner]} + axis];
    }
  }
};

// The face's normal, scaled so that a vertex's gradient is this times its barycentric coordinate.
void scaledNormal(const OctahedraBackward& a, uint32_t sample, float out[3]) {
  const uint32_t number = hostPointer(a.faces)[sample];
  const OctahedraGrid& grid = a.grids[number / kFacesPerCell / a.grids[0].cells()];
  const FaceVertices face(grid, hostPointer(a.displacements), number);
  const size_t ray = hostPointer(a.rayOfSample)[sample];
  const HomogeneousRay line(grid, hostPointer(a.origins) + 3 * ray, hostPointer(a.directions) + 3 * ray);
  const double t = hostPointer(a.distances)[sample], scale = line.start[3] + t * line.slope[3];
  double normal[3], slope[3], across = 0, along = 0, normalSquare = 0, slopeSquare = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const int x = (axis + 1) % 3, y = (axis + 2) % 3;
    normal[axis] = (face.at[1][x] - face.at[0][x]) * (face.at[2][y] - face.at[0][y]) -
                   (face.at[1][y] - face.at[0][y]) * (face.at[2][x] - face.at[0][x]);
    slope[axis] = (line.slope[axis] - line.at(t, axis) * line.slope[3]) / scale;
    across += normal[axis] * slope[axis];
    along += slope[axis] * hostPointer(a.positionGradients)[3 * size_t{sample} + axis];
    normalSquare += normal[axis] * normal[axis];
    slopeSquare += slope[axis] * slope[axis];
  }
  across = std::copysign(std::max(std::abs(across), a.minCosine * std::sqrt(normalSquare * slopeSquare)), across);
  along *= grid.positionScale();
  if (a.distanceGradients) along += hostPointer(a.distanceGradients)[sample];
  for (int axis = 0; axis < 3; ++axis)
    out[axis] = across == 0 ? 0.0f : static_cast<float>(along / across * normal[axis]);
}

}  // namespace

void run(Context& context, const OctahedraBackward& a) {
  const uint32_t samples = hostCount(a.samples);
  std::vector<float> normals(size_t{3} * samples);
  context.pool.forRanges(samples, 1024, [&](size_t begin, size_t end) {
    for (size_t sample = begin; sample < end; ++sample)
      scaledNormal(a, static_cast<uint32_t>(sample), &normals[3 * sample]);
  });
  // One thread adds, because samples share vertices; this is a small part of the work.
  float* const sums = hostPointer(a.displacementGradients);
  const float* const barycentrics = hostPointer(a.barycentrics);
  for (size_t sample = 0; sample < samples; ++sample) {
    const FaceVertices face(a.grids[0], hostPointer(a.displacements), hostPointer(a.faces)[sample]);
    const float second = barycentrics[2 * sample], third = barycentrics[2 * sample + 1];
    const float shares[3] = {1 - second - third, second, third};
    for (int corner = 0; corner < 3; ++corner) {
      float* const to = sums + 3 * size_t{face.cell[corner]};
      for (int axis = 0; axis < 3; ++axis) to[axis] += shares[corner] * normals[3 * sample + axis];
    }
  }
}

void run(Context& context, const MergeOctahedra& a) {
  const uint32_t n = a.resolution, coarse = n / 2;
  CHECK(n % 2 == 0u);
  const size_t listed = a.cells.count;
  const uint32_t* const cells = hostPointer(a.cells);
  const float* const x = hostPointer(a.x.data);
  float* const opacities = hostPointer(a.opacities);
  std::fill_n(opacities, size_t{n} * n * n, 0.0f);
  context.pool.forRanges(listed, 1024, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      float sum = 0;
      for (size_t p = 0; p < a.points; ++p) sum += 1 / (1 + std::exp(-x[a.x.offset(p * listed + i, 0)] - a.offset));
      opacities[cells[i]] = sum / static_cast<float>(a.points);
    }
  });
  const float* const displacements = hostPointer(a.displacements);
  float* const merged = hostPointer(a.mergedDisplacements);
  context.pool.forRanges(size_t{coarse} * coarse * coarse, 1024, [&](size_t begin, size_t end) {
    for (size_t cell = begin; cell < end; ++cell) {
      const size_t place[3] = {cell % coarse, cell / coarse % coarse, cell / (size_t{coarse} * coarse)};
      float largest = MergeOctahedra::kTransparent;
      std::fill_n(merged + 3 * cell, 3, 0.0f);
      for (size_t child = 0; child < 8; ++child) {
        const size_t side[3] = {child & 1, child >> 1 & 1, child >> 2};
        const size_t fine = 2 * place[0] + side[0] + n * (2 * place[1] + side[1] + n * (2 * place[2] + side[2]));
        if (!(opacities[fine] > largest)) continue;
        largest = opacities[fine];
        for (int axis = 0; axis < 3; ++axis)
          merged[3 * cell + axis] = 0.5f * (static_cast<float>(side[axis]) - 0.5f + displacements[3 * fine + axis]);
      }
    }
  });
}

}  // namespace tessera::cpu
