#include "representations/mesh/train/face_set.h"

#include <algorithm>
#include <array>
#include <bit>
#include <unordered_set>

namespace tessera {

bool faceExists(OctahedraGrids grids, uint32_t face) {
  const uint32_t n = grids[0].resolution, cell = face / kFacesPerCell % grids[0].cells();
  const int place[3] = {static_cast<int>(cell % n), static_cast<int>(cell / n % n), static_cast<int>(cell / (n * n))};
  for (const auto& corner : octahedronFace(face % kFacesPerCell))
    for (int axis = 0; axis < 3; ++axis)
      if (static_cast<uint32_t>(place[axis] + corner[axis]) >= n) return false;  // -1 wraps beyond the grid
  return true;
}

void FaceSet::add(uint32_t face, const Vec3f& direction, float contribution) {
  add(face);
  Seen& seen = seen_[face];
  seen.direction += direction;
  seen.contribution += contribution;
}

void FaceSet::dropLeast(double share) {
  if (share <= 0) return;
  const auto contribution = [&](uint32_t face) {
    const auto entry = seen_.find(face);
    return entry == seen_.end() ? 0 : entry->second.contribution;
  };
  std::vector<uint32_t> faces = numbers();
  double rest = 0;
  for (const uint32_t face : faces) rest += share * contribution(face);
  std::stable_sort(faces.begin(), faces.end(),
                   [&](uint32_t a, uint32_t b) { return contribution(a) < contribution(b); });
  for (const uint32_t face : faces) {
    rest -= contribution(face);
    if (rest < 0) return;
    remove(face);
    seen_.erase(face);
  }
}

FaceSet FaceSet::quads(OctahedraGrids grids) {
  FaceSet quads(grids);
  for (uint32_t cell = 0; cell < grids[0].cells() * grids.size(); ++cell) {
    for (uint32_t local = kOuterFaces; local < kFacesPerCell; ++local) {
      const uint32_t signs = (local - kOuterFaces) % 4;
      if (signs == 0 || signs == 3)
        quads.add(kFacesPerCell * cell + local);  // c, c + a, c + b; c + a + b, c + b, c + a
    }
  }
  return quads;
}

FaceSet FaceSet::neighbours(OctahedraGrids grids) const {
  const int n = static_cast<int>(grids[0].resolution);
  const uint32_t cells = grids[0].cells();
  // Calls use(edge) for the three edges of a face, pairs of the numbers of its vertices' cells in all grids.
  const auto forEachEdge = [&](uint32_t face, const auto& use) {
    std::array<uint64_t, 3> vertices{};
    for (size_t i = 0; i < 3; ++i) {
      const auto corner = octahedronFace(face % kFacesPerCell)[i];
      vertices[i] = static_cast<uint64_t>(int64_t{face / kFacesPerCell} + corner[0] + n * (corner[1] + n * corner[2]));
    }
    for (size_t i = 0; i < 3; ++i) {
      const auto [low, high] = std::minmax(vertices[i], vertices[(i + 1) % 3]);
      use(low << 32 | high);
    }
  };
  std::unordered_set<uint64_t> edges;
  for (const uint32_t face : numbers()) forEachEdge(face, [&](uint64_t edge) { edges.insert(edge); });
  FaceSet neighbours(grids);
  for (uint32_t cell = 0; cell < cells * grids.size(); ++cell) {
    const uint32_t at = cell % cells, resolution = grids[0].resolution;
    if (!carriesOctahedron(grids[0].placement, at % resolution, at / resolution % resolution,
                           at / (resolution * resolution)))
      continue;
    for (uint32_t local = 0; local < kFacesPerCell; ++local) {
      const uint32_t face = kFacesPerCell * cell + local;
      if (contains(face) || !faceExists(grids, face)) continue;
      forEachEdge(face, [&](uint64_t edge) {
        if (edges.contains(edge)) neighbours.add(face);
      });
    }
  }
  return neighbours;
}

size_t FaceSet::count() const {
  size_t faces = 0;
  for (const uint32_t word : bits_) faces += static_cast<size_t>(std::popcount(word));
  return faces;
}

Vec3f FaceSet::direction(uint32_t face) const {
  const auto entry = seen_.find(face);
  return entry == seen_.end() ? Vec3f(Vec3f::Zero()) : entry->second.direction;
}

std::vector<uint32_t> FaceSet::numbers() const {
  std::vector<uint32_t> numbers;
  for (uint32_t word = 0; word < bits_.size(); ++word)
    for (uint32_t bits = bits_[word]; bits != 0; bits &= bits - 1)
      numbers.push_back(32 * word + static_cast<uint32_t>(std::countr_zero(bits)));
  return numbers;
}

}  // namespace tessera
