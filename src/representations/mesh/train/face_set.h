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
  // Adds the face and a direction in which it is seen, whose length is its weight.
  void add(uint32_t face, const Vec3f& direction);
  void remove(uint32_t face) { bits_[face / 32] &= ~(1u << face % 32); }
  bool contains(uint32_t face) const { return (bits_[face / 32] >> face % 32 & 1) != 0; }
  bool empty() const { return bits_.empty(); }
  size_t count() const;
  // The sum of the directions of a face; zero if there are none.
  Vec3f direction(uint32_t face) const;
  // The numbers of the faces, in ascending order.
  std::vector<uint32_t> numbers() const;
  // Bits, as TraceOctahedra::keptFaces.
  const std::vector<uint32_t>& bits() const { return bits_; }

 private:
  std::vector<uint32_t> bits_;
  std::unordered_map<uint32_t, Vec3f> directions_;
};

}  // namespace tessera
