#include "golden/golden_volume.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "raymarch/content/occupancy_pyramid.h"

namespace tessera::golden {
namespace {

uint8_t quantised(double value, double range) {
  return static_cast<uint8_t>(std::clamp(std::floor(255 * (value + range) / (2 * range) + 0.5), 0.0, 255.0));
}

class VolumePartMaker {
 public:
  VolumePartMaker(VolumePart& part, const VolumeContent& content)
      : part_(part), content_(content), voxels_(part, part.voxels) {}

  void make() {
    makeMacroblocks();
    makePlanes();
    makeDistances();
  }

 private:
  void makeMacroblocks() {
    constexpr uint32_t kEdge = VolumePart::kMacroblock;
    const uint32_t edge = part_.voxels / kEdge;
    uint32_t stored = 0;
    for (uint32_t z = 0; z < edge; ++z) {
      for (uint32_t y = 0; y < edge; ++y) {
        for (uint32_t x = 0; x < edge; ++x) {
          const Triple<uint32_t> first = {kEdge * x, kEdge * y, kEdge * z};
          if (!voxels_.isAnythingIn(first, {first[0] + kEdge, first[1] + kEdge, first[2] + kEdge})) {
            part_.macroblocks.push_back(VolumePart::kEmpty);
            continue;
          }
          part_.macroblocks.push_back(stored++);
          storeMacroblock(first);
        }
      }
    }
  }

  void storeMacroblock(const Triple<uint32_t>& first) {
    const uint32_t n = part_.voxels, maximum = n - 1;
    for (uint32_t k = 0; k < VolumePart::kStoredEdge; ++k) {
      for (uint32_t j = 0; j < VolumePart::kStoredEdge; ++j) {
        for (uint32_t i = 0; i < VolumePart::kStoredEdge; ++i) {
          const uint32_t x = std::min(first[0] + i, maximum), y = std::min(first[1] + j, maximum),
                         z = std::min(first[2] + k, maximum);
          part_.voxelBytes.push_back(quantised(voxels_.at(x, y, z), content_.densityRange));
          const auto p = inScene(part_, {middle(part_, x, n), middle(part_, y, n), middle(part_, z, n)});
          for (uint64_t a = 0; a < 7; ++a) {
            part_.voxelBytes.push_back(
                quantised(1.5 * noise(20 + a, 2 * p[0] + p[2], 2 * p[1]), content_.featureRange));
          }
        }
      }
    }
  }

  void makePlanes() {
    for (size_t axis = 0; axis < 3; ++axis) {
      const size_t b = axis == 0 ? 1 : 0, c = axis == 2 ? 1 : 2;
      for (uint32_t row = 0; row < part_.planes; ++row) {
        for (uint32_t column = 0; column < part_.planes; ++column) {
          Triple<double> inDomain = {0, 0, 0};
          inDomain[b] = middle(part_, column, part_.planes);
          inDomain[c] = middle(part_, row, part_.planes);
          const auto p = inScene(part_, inDomain);
          std::vector<uint8_t>& bytes = part_.planeBytes[axis];
          bytes.push_back(quantised(0.4 * noise(40 + axis, 3 * p[b], 3 * p[c]), content_.densityRange));
          for (uint64_t a = 0; a < 7; ++a) {
            const double detail = noise(50 + 8 * axis + a, 4 * p[b], 4 * p[c]);
            bytes.push_back(quantised((axis == 2 ? 3 : 1) * detail, content_.featureRange));
          }
        }
      }
    }
  }

  // A cell is occupied if a voxel that is interpolated into one of its samples is dense and not merely hidden.
  void makeDistances() {
    const uint32_t cells = part_.planes / VolumePart::kDistanceCell, side = part_.voxels / cells;
    OccupancyBits occupied(cells);
    const auto below = [&](uint32_t index) { return index == 0 ? 0 : side * index - 1; };
    for (uint32_t z = 0; z < cells; ++z) {
      for (uint32_t y = 0; y < cells; ++y) {
        for (uint32_t x = 0; x < cells; ++x) {
          if (voxels_.isAnythingIn({below(x), below(y), below(z)}, {side * (x + 1), side * (y + 1), side * (z + 1)})) {
            occupied.set(occupied.number(x, y, z));
          }
        }
      }
    }
    part_.distances = chebyshevDistances(occupied);
  }

  VolumePart& part_;
  const VolumeContent& content_;
  Densities voxels_;
};

VolumeContent makeGoldenContent(uint64_t seed, const std::vector<VolumePart>& parts) {
  VolumeContent content;
  const RandomStream random(seed, 7);
  uint64_t next = 0;
  content.network = makeNetwork(34, random, next);
  content.parts = parts;
  for (VolumePart& part : content.parts) VolumePartMaker(part, content).make();
  return content;
}

VolumePart blockPart(uint32_t column, uint32_t voxels, uint32_t planes) {
  VolumePart part;
  part.voxels = voxels;
  part.planes = planes;
  placeBlock(part, column);
  return part;
}

VolumePart backgroundBlockPart(uint32_t voxels, uint32_t planes) {
  VolumePart part;
  part.voxels = voxels;
  part.planes = planes;
  placeBackgroundBlock(part);
  return part;
}

}  // namespace

Scene<VolumeContent> makeVolumeScene() {
  Scene<VolumeContent> scene;
  scene.tileset = landscapeTileset(kVolumeName, 64);
  scene.contents["0_0"] = makeGoldenContent(1, {blockPart(0, 32, 64)});
  scene.contents["1_0"] = makeGoldenContent(2, {blockPart(1, 32, 64)});
  scene.contents["all"] = makeGoldenContent(3, {blockPart(0, 16, 32), blockPart(1, 16, 32)});
  scene.contents["all"].stepsPerTexel = 2;
  scene.contents["background_block"] = makeGoldenContent(4, {backgroundBlockPart(32, 64)});
  scene.contents["coarse_background_block"] = makeGoldenContent(5, {backgroundBlockPart(16, 32)});
  scene.contents["coarse_background_block"].stepsPerTexel = 2;
  return scene;
}

VolumeSums computeSums(const VolumePart& part) {
  VolumeSums sums;
  sums.stored = part.storedMacroblocks();
  const auto first = std::find(part.macroblocks.begin(), part.macroblocks.end(), 0u);
  sums.firstStored = static_cast<uint64_t>(first - part.macroblocks.begin());
  for (const uint8_t distance : part.distances) {
    sums.occupied += distance == 0;
    sums.distances += distance;
  }
  sums.voxels = computeSums(part.voxelBytes);
  for (size_t axis = 0; axis < 3; ++axis) sums.planes[axis] = computeSums(part.planeBytes[axis]);
  return sums;
}

nlohmann::ordered_json toJson(const VolumeSums& sums) {
  nlohmann::ordered_json planes, planesOrdered;
  for (const ByteSums& plane : sums.planes) {
    planes.push_back(plane.sum);
    planesOrdered.push_back(plane.ordered);
  }
  return {{"stored", sums.stored},     {"firstStored", sums.firstStored},
          {"occupied", sums.occupied}, {"distances", sums.distances},
          {"voxels", sums.voxels.sum}, {"voxelsOrdered", sums.voxels.ordered},
          {"planes", planes},          {"planesOrdered", planesOrdered}};
}

}  // namespace tessera::golden
