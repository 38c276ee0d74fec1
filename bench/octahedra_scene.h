// What octahedra_embree.cpp measures: grids of octahedra, rays, and the triangles that TraceOctahedra can hit, as a
// list.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "bench/embree_hits.h"
#include "compute/device.h"
#include "compute/octahedra.h"
#include "train/scene_frame.h"

namespace tessera {

inline constexpr uint32_t kBatch = 16384;  // rays that are traced at a time, the most of a training step

struct TracedGrid {
  std::string name;
  OctahedraGrid grid;                 // affine
  std::vector<float> displacements;   // [cells][3]
  std::vector<uint32_t> tracedCells;  // bits, [words()]
};

// A grid of 64³ cells over the scene [-1,1]³ with three layers of traced cells on a wavy height field. Vertices are
// moved at random by up to `share` of the bound of displacements.
TracedGrid makeSyntheticGrid(double share);

struct RaySet {
  std::string order;
  std::vector<float> origins, directions;          // [rays][3], in the scene
  std::vector<float> gridOrigins, gridDirections;  // [rays][3], in grid coordinates

  uint32_t count() const { return static_cast<uint32_t>(origins.size() / 3); }
  void add(const OctahedraGrid& grid, const float* origin, const float* direction);
};

// Groups of 8 × 8 pixels that look at random points of the surface of the synthetic grid, from a plane as high above it
// as the grid is wide, up to 35 degrees from straight down. On the ground, pixels are a tenth of a cell wide.
RaySet makeSyntheticRays(const OctahedraGrid& grid);
// The rays through all pixels of photos that cross the grid, by groups of 8 × 8 pixels. Photos are given as numbers in
// the capture, and the scene by its frame.
RaySet makePhotoRays(Device& device, const Capture& capture, std::span<const int> photos, const SceneFrame& frame,
                     const OctahedraGrid& grid);
// The same rays in random order.
RaySet shuffle(const RaySet& rays, const OctahedraGrid& grid);

struct FaceTriangles {
  TriangleSet triangles;              // in grid coordinates
  std::vector<uint32_t> faces;        // the number of each triangle's face, ascending
  std::vector<uint32_t> vertexCells;  // the cell of each vertex, ascending
};
// Returns all faces that exist and whose box of cells reaches a traced cell.
FaceTriangles listTriangles(const TracedGrid& traced);

// Returns the vertices of cells in grid coordinates, [cells][3].
std::vector<float> placeVertices(const OctahedraGrid& grid, const std::vector<uint32_t>& cells,
                                 const std::vector<float>& displacements);

}  // namespace tessera
