// Orders the patches of a content for rasterisers: for caches of vertices and texels, and so that surfaces that hide
// others are drawn before them.
#pragma once

#include "representations/mesh/bake/baked_patches.h"

namespace tessera {

// Triangles whose corners at equal places are one vertex. Vertices are numbered in the order of their first use.
struct IndexedTriangles {
  std::vector<float> vertices;    // [vertices][3]
  std::vector<uint32_t> indices;  // [triangles][3]

  size_t vertexCount() const { return vertices.size() / 3; }
};
// `corners`: [triangles][3][3].
IndexedTriangles indexTriangles(std::span<const float> corners);
// Returns the triangles of the given patches, in this order. They are counterclockwise as rays see them.
IndexedTriangles indexTriangles(const BakedPatches& patches, std::span<const uint32_t> numbers);

// Returns the numbers of the given patches in their order in a content, the pairs first. meshoptimizer orders the
// triangles: for a cache of vertices, and then groups of them against overdraw as far as that costs few more vertices
// (Sander, Nehab and Barczak 2007, "Fast triangle reordering for vertex locality and reduced overdraw"). A patch is
// where the first of its triangles is. The result depends on the arguments alone.
std::vector<uint32_t> orderPatches(const BakedPatches& patches, std::span<const uint32_t> numbers);

}  // namespace tessera
