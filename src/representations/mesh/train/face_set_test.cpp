#include "representations/mesh/train/face_set.h"

#include <gtest/gtest.h>

#include <array>
#include <set>

namespace tessera {
namespace {

TEST(FaceSet, ListsTheFacesThatShareAnEdge) {
  OctahedraGrid grid;
  grid.resolution = 6;
  const std::vector<OctahedraGrid> grids = {grid};
  FaceSet set(grids);
  const uint32_t cell = 2 + 6 * (3 + 6 * 3), face = kFacesPerCell * cell + kOuterFaces;  // an inner face
  set.add(face);
  const FaceSet neighbours = set.neighbours(grids);
  EXPECT_FALSE(neighbours.contains(face));
  std::set<std::array<int, 3>> corners;
  for (const auto& corner : octahedronFace(kOuterFaces)) corners.insert(corner);
  size_t ofTheSame = 0;
  for (uint32_t local = 0; local < kFacesPerCell; ++local) {
    size_t shared = 0;
    for (const auto& corner : octahedronFace(local)) shared += corners.count(corner);
    EXPECT_EQ(neighbours.contains(kFacesPerCell * cell + local), shared == 2) << local;
    ofTheSame += shared == 2 ? 1 : 0;
  }
  EXPECT_GT(neighbours.count(), ofTheSame) << "those of other octahedra at the outer edge";
  EXPECT_LT(neighbours.count(), 3u * kFacesPerCell);
  EXPECT_EQ(FaceSet(grids).neighbours(grids).count(), 0u);
}

}  // namespace
}  // namespace tessera
