#include "representations/mesh/bake/patch_order.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <map>

namespace tessera {
namespace {

constexpr float kVertexCostLimit = 1.05f;  // vertices that may be computed for less overdraw, relative to the fewest
constexpr size_t kVertexBytes = 3 * sizeof(float);

using Corners = std::array<uint32_t, 3>;

// Adds a triangle of a patch. What is counterclockwise is its outside for meshoptimizer.
void addTriangle(const BakedPatches& patches, uint32_t patch, Corners numbers, std::vector<float>& corners) {
  std::array<Vec3d, 3> x;
  for (size_t i = 0; i < x.size(); ++i) x[i] = patches.corner(patch, numbers[i]);
  if ((x[1] - x[0]).cross(x[2] - x[0]).dot(patches.direction(patch)) > 0) std::swap(x[1], x[2]);
  for (const Vec3d& corner : x)
    for (int axis = 0; axis < 3; ++axis) corners.push_back(static_cast<float>(corner[axis]));
}

IndexedTriangles orderTriangles(const IndexedTriangles& triangles) {
  const size_t indices = triangles.indices.size(), vertices = triangles.vertexCount();
  std::vector<uint32_t> forCache(indices);
  meshopt_optimizeVertexCache(forCache.data(), triangles.indices.data(), indices, vertices);
  IndexedTriangles ordered = triangles;
  meshopt_optimizeOverdraw(ordered.indices.data(), forCache.data(), indices, ordered.vertices.data(), vertices,
                           kVertexBytes, kVertexCostLimit);
  return ordered;
}

// The vertices of a triangle, which name it whatever its first corner is.
Corners findVertices(const IndexedTriangles& triangles, size_t triangle) {
  Corners vertices;
  std::copy_n(triangles.indices.begin() + static_cast<ptrdiff_t>(3 * triangle), 3, vertices.begin());
  std::sort(vertices.begin(), vertices.end());
  return vertices;
}

// Orders patches that all have the same number of triangles.
void addInOrder(const BakedPatches& patches, std::span<const uint32_t> numbers, std::vector<uint32_t>& to) {
  if (numbers.empty()) return;
  const IndexedTriangles triangles = indexTriangles(patches, numbers), ordered = orderTriangles(triangles);
  const size_t count = triangles.indices.size() / 3, ofPatch = count / numbers.size();
  std::map<Corners, size_t> placeOfTriangle;  // the first, if several have the same corners
  for (size_t place = 0; place < count; ++place) placeOfTriangle.emplace(findVertices(ordered, place), place);
  std::vector<std::pair<size_t, uint32_t>> places;
  for (size_t i = 0; i < numbers.size(); ++i) {
    size_t first = count;
    for (size_t triangle = i * ofPatch; triangle < (i + 1) * ofPatch; ++triangle)
      first = std::min(first, placeOfTriangle.at(findVertices(triangles, triangle)));
    places.emplace_back(first, numbers[i]);
  }
  std::sort(places.begin(), places.end());
  for (const auto& [place, patch] : places) to.push_back(patch);
}

}  // namespace

IndexedTriangles indexTriangles(std::span<const float> corners) {
  IndexedTriangles triangles;
  const size_t count = corners.size() / 3;
  triangles.indices.resize(count);
  const size_t vertices =
      meshopt_generateVertexRemap(triangles.indices.data(), nullptr, count, corners.data(), count, kVertexBytes);
  triangles.vertices.resize(3 * vertices);
  meshopt_remapVertexBuffer(triangles.vertices.data(), corners.data(), count, kVertexBytes, triangles.indices.data());
  return triangles;
}

IndexedTriangles indexTriangles(const BakedPatches& patches, std::span<const uint32_t> numbers) {
  std::vector<float> corners;
  for (const uint32_t patch : numbers) {
    addTriangle(patches, patch, {0, 1, 2}, corners);
    if (patch < patches.pairs) addTriangle(patches, patch, {3, 2, 1}, corners);
  }
  return indexTriangles(corners);
}

std::vector<uint32_t> orderPatches(const BakedPatches& patches, std::span<const uint32_t> numbers) {
  std::vector<uint32_t> pairs, singles, ordered;
  for (const uint32_t patch : numbers) (patch < patches.pairs ? pairs : singles).push_back(patch);
  addInOrder(patches, pairs, ordered);
  addInOrder(patches, singles, ordered);
  return ordered;
}

}  // namespace tessera
