// The faces of octahedra grids that rays see, and the directions in which they see them.
#pragma once

#include <unordered_map>
#include <vector>

#include "compute/octahedra.h"
#include "scene/axes.h"

namespace tessera {

// Whether a face, whose number is below that of all faces of the grids, has all vertices in its grid.
bool faceExists(OctahedraGrids grids, uint32_t face);

class FaceSet {
 public:
  FaceSet() = default;
  explicit FaceSet(OctahedraGrids grids) : bits_(faceWords(grids)) {}

  void add(uint32_t face) { bits_[face / 32] |= 1u << face % 32; }
  // Adds the face and a direction in which it is seen, whose length is its weight. `contribution`: to the ray that
  // sees it.
  void add(uint32_t face, const Vec3f& direction, float contribution = 0);
  void remove(uint32_t face) { bits_[face / 32] &= ~(1u << face % 32); }
  bool contains(uint32_t face) const { return (bits_[face / 32] >> face % 32 & 1) != 0; }
  bool empty() const { return bits_.empty(); }
  size_t count() const;
  // Removes the faces that contribute least, at most the given share of all contributions.
  void dropLeast(double share);
  // The sum of the directions of a face; zero if there are none.
  Vec3f direction(uint32_t face) const;
  // The numbers of the faces, in ascending order.
  std::vector<uint32_t> numbers() const;
  // The faces that share an edge with one of these and are not among them.
  FaceSet neighbours(OctahedraGrids grids) const;
  // The triangles of MobileNeRF's grid (Chen et al. 2023, section 3.1) among those of octahedra in all cells: for two
  // axes, the vertices of the cells c, c + a, c + b and c + a + b form a quad.
  static FaceSet quads(OctahedraGrids grids);
  // Bits, as TraceOctahedra::keptFaces.
  const std::vector<uint32_t>& bits() const { return bits_; }

 private:
  std::vector<uint32_t> bits_;
  struct Seen {
    Vec3f direction = Vec3f::Zero();
    float contribution = 0;
  };
  std::unordered_map<uint32_t, Seen> seen_;
};

}  // namespace tessera
