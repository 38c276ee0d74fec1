#include "representations/mesh/train/face_set.h"

#include <bit>

namespace tessera {

bool faceExists(OctahedraGrids grids, uint32_t face) {
  const uint32_t n = grids[0].resolution, cell = face / kFacesPerCell % grids[0].cells();
  const int place[3] = {static_cast<int>(cell % n), static_cast<int>(cell / n % n), static_cast<int>(cell / (n * n))};
  for (const auto& corner : octahedronFace(face % kFacesPerCell))
    for (int axis = 0; axis < 3; ++axis)
      if (static_cast<uint32_t>(place[axis] + corner[axis]) >= n) return false;  // -1 wraps beyond the grid
  return true;
}

void FaceSet::add(uint32_t face, const Vec3f& direction) {
  add(face);
  directions_.try_emplace(face, Vec3f::Zero()).first->second += direction;
}

size_t FaceSet::count() const {
  size_t faces = 0;
  for (const uint32_t word : bits_) faces += static_cast<size_t>(std::popcount(word));
  return faces;
}

Vec3f FaceSet::direction(uint32_t face) const {
  const auto entry = directions_.find(face);
  return entry == directions_.end() ? Vec3f(Vec3f::Zero()) : entry->second;
}

std::vector<uint32_t> FaceSet::numbers() const {
  std::vector<uint32_t> numbers;
  for (uint32_t word = 0; word < bits_.size(); ++word)
    for (uint32_t bits = bits_[word]; bits != 0; bits &= bits - 1)
      numbers.push_back(32 * word + static_cast<uint32_t>(std::countr_zero(bits)));
  return numbers;
}

}  // namespace tessera
