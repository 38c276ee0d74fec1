#include "golden/golden_volume.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "scene/contraction.h"
#include "tiles/occupancy_pyramid.h"

namespace tessera::golden {
namespace {

constexpr uint32_t kColumns = 2, kRows = 1;
constexpr double kBottom = -0.75, kTop = 0.75;

// Smooth, in [-1,1]: random values at whole numbers, mixed.
double noise(uint64_t stream, double x, double y) {
  const double i = std::floor(x), j = std::floor(y);
  const auto smooth = [](double t) { return t * t * (3 - 2 * t); };
  const double u = smooth(x - i), v = smooth(y - j);
  const RandomStream random(2024, stream);
  const auto at = [&](double a, double b) {
    const auto index = static_cast<uint64_t>(static_cast<int64_t>(a) + 4096) * 8192 +
                       static_cast<uint64_t>(static_cast<int64_t>(b) + 4096);
    return 2 * random.uniformDouble(index) - 1;
  };
  return (1 - v) * ((1 - u) * at(i, j) + u * at(i + 1, j)) + v * ((1 - u) * at(i, j + 1) + u * at(i + 1, j + 1));
}

// The height of what stands at x, y: rolling ground, and one building in each block.
double heightAt(double x, double y) {
  const double fromMiddle = std::abs(std::abs(x) - 1);
  if (fromMiddle < 0.4 && std::abs(y) < 0.3 && std::abs(x) < 2) return x < 0 ? 0.45 : 0.1;
  return -0.45 + 0.12 * noise(1, 1.5 * x, 1.5 * y);
}

uint8_t quantised(double value, double range) {
  return static_cast<uint8_t>(std::clamp(std::floor(255 * (value + range) / (2 * range) + 0.5), 0.0, 255.0));
}

Triple<double> inScene(const VolumePart& part, const Triple<double>& inDomain) {
  const Triple<double> q = part.contracted ? uncontract(inDomain) : inDomain;
  return {part.centre[0] + part.scale[0] * q[0], part.centre[1] + part.scale[1] * q[1],
          part.centre[2] + part.scale[2] * q[2]};
}

// A texel's coordinate along an axis of the domain.
double middle(const VolumePart& part, uint32_t index, uint32_t count) {
  const double h = part.halfDomain();
  return -h + 2 * h * (index + 0.5) / count;
}

class PartMaker {
 public:
  PartMaker(VolumePart& part, const VolumeContent& content) : part_(part), content_(content) {}

  void make() {
    makeLogDensities();
    makeMacroblocks();
    makePlanes();
    makeDistances();
  }

 private:
  double& logDensity(uint32_t x, uint32_t y, uint32_t z) {
    return logDensities_[x + size_t{part_.voxels} * (y + size_t{part_.voxels} * z)];
  }

  void makeLogDensities() {
    const uint32_t n = part_.voxels;
    logDensities_.resize(size_t{n} * n * n);
    for (uint32_t z = 0; z < n; ++z) {
      for (uint32_t y = 0; y < n; ++y) {
        for (uint32_t x = 0; x < n; ++x) {
          const auto p = inScene(part_, {middle(part_, x, n), middle(part_, y, n), middle(part_, z, n)});
          const double above = p[2] - heightAt(p[0], p[1]);
          logDensity(x, y, z) = std::clamp(-60 * above, -12.0, 6.0);
        }
      }
    }
  }

  // Whether anything is dense among the voxels from `first` to `last` along each axis, clamped.
  bool isAnythingIn(const Triple<uint32_t>& first, const Triple<uint32_t>& last) {
    const uint32_t most = part_.voxels - 1;
    bool dense = false, hollow = false;
    for (uint32_t z = first[2]; z <= std::min(last[2], most); ++z) {
      for (uint32_t y = first[1]; y <= std::min(last[1], most); ++y) {
        for (uint32_t x = first[0]; x <= std::min(last[0], most); ++x) {
          dense = dense || logDensity(x, y, z) > -6;
          hollow = hollow || logDensity(x, y, z) < 3;
        }
      }
    }
    return dense && (hollow || first[2] == 0);  // what lies deep below is never seen
  }

  void makeMacroblocks() {
    constexpr uint32_t kEdge = VolumePart::kMacroblock;
    const uint32_t edge = part_.voxels / kEdge;
    uint32_t stored = 0;
    for (uint32_t z = 0; z < edge; ++z) {
      for (uint32_t y = 0; y < edge; ++y) {
        for (uint32_t x = 0; x < edge; ++x) {
          const Triple<uint32_t> first = {kEdge * x, kEdge * y, kEdge * z};
          if (!isAnythingIn(first, {first[0] + kEdge, first[1] + kEdge, first[2] + kEdge})) {
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
    const uint32_t n = part_.voxels, most = n - 1;
    for (uint32_t k = 0; k < VolumePart::kStoredEdge; ++k) {
      for (uint32_t j = 0; j < VolumePart::kStoredEdge; ++j) {
        for (uint32_t i = 0; i < VolumePart::kStoredEdge; ++i) {
          const uint32_t x = std::min(first[0] + i, most), y = std::min(first[1] + j, most),
                         z = std::min(first[2] + k, most);
          part_.voxelBytes.push_back(quantised(logDensity(x, y, z), content_.densityRange));
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

  // A cell may hold something where a voxel that is mixed into a sample in it is dense, and not only hidden ones.
  void makeDistances() {
    const uint32_t cells = part_.planes / VolumePart::kDistanceCell, side = part_.voxels / cells;
    OccupancyBits occupied(cells);
    const auto below = [&](uint32_t index) { return index == 0 ? 0 : side * index - 1; };
    for (uint32_t z = 0; z < cells; ++z) {
      for (uint32_t y = 0; y < cells; ++y) {
        for (uint32_t x = 0; x < cells; ++x) {
          if (isAnythingIn({below(x), below(y), below(z)}, {side * (x + 1), side * (y + 1), side * (z + 1)})) {
            occupied.set(occupied.number(x, y, z));
          }
        }
      }
    }
    part_.distances = chebyshevDistances(occupied);
  }

  VolumePart& part_;
  const VolumeContent& content_;
  std::vector<double> logDensities_;
};

VolumeContent contentOf(uint64_t seed, const std::vector<VolumePart>& parts) {
  VolumeContent content;
  const RandomStream random(seed, 7);
  uint64_t next = 0;
  for (const auto& [inputs, outputs] : {std::pair{34u, 16u}, {16u, 16u}, {16u, 3u}}) {
    DenseLayer layer{inputs, outputs, {}, {}};
    for (uint32_t i = 0; i < inputs * outputs; ++i) layer.weights.push_back(random.uniform(next++) - 0.5f);
    for (uint32_t i = 0; i < outputs; ++i) layer.biases.push_back(random.uniform(next++) - 0.5f);
    content.network.push_back(std::move(layer));
  }
  content.parts = parts;
  for (VolumePart& part : content.parts) PartMaker(part, content).make();
  return content;
}

VolumePart blockPart(uint32_t column, uint32_t voxels, uint32_t planes) {
  VolumePart part;
  part.voxels = voxels;
  part.planes = planes;
  part.centre = {2.0f * static_cast<float>(column) + 1 - static_cast<float>(kColumns), 0, 0};
  part.low = {part.centre[0] - 1, -1, static_cast<float>(kBottom)};
  part.high = {part.centre[0] + 1, 1, static_cast<float>(kTop)};
  return part;
}

VolumePart surroundPart(uint32_t voxels, uint32_t planes) {
  VolumePart part;
  part.voxels = voxels;
  part.planes = planes;
  part.scale = {kColumns, kRows, 1};
  part.contracted = part.surround = true;
  part.low = {-1e4f, -1e4f, -1e4f};
  part.high = {1e4f, 1e4f, 1e4f};
  return part;
}

Tile tileOf(const Tileset& tileset, uint32_t level, const CellRange& cells) {
  Tile tile;
  tile.level = level;
  tile.cells = cells;
  tile.box = tileset.boxOf(cells);
  tile.contents.resize(1);
  tile.contents[0].cells = cells;
  tile.contents[0].box = tile.box;
  return tile;
}

}  // namespace

Scene makeScene() {
  Scene scene;
  Tileset& tileset = scene.tileset;
  tileset.name = "golden";
  tileset.worldFromScene.rotation << 0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1;
  tileset.worldFromScene.scale = 25;
  tileset.worldFromScene.translation = {10, -20, 5};
  tileset.sourceFromWorld.topLeftCorner<3, 3>() *= 0.5;
  tileset.sourceFromWorld.topRightCorner<3, 1>() = Vec3d(1, 2, 3);
  tileset.georeference = GeoFrame{50.8225, -0.1372, 12, Mat4d::Identity()};
  tileset.columns = kColumns;
  tileset.rows = kRows;
  tileset.bottom = kBottom;
  tileset.top = kTop;
  tileset.background = {0.5f, 0.625f, 0.75f};
  tileset.levels = 2;
  const double texel = 25 * 2.0 / 64;  // metres
  tileset.geometricError = 100;
  tileset.tiles = {tileOf(tileset, 1, tileset.allCells()), tileOf(tileset, 0, {{0, 0}, {1, 1}}),
                   tileOf(tileset, 0, {{1, 0}, {2, 1}})};
  tileset.tiles[0].geometricError = 2 * texel;
  tileset.tiles[1].geometricError = tileset.tiles[2].geometricError = texel;
  tileset.tiles[0].children = {1, 2};
  TileContent surround;
  surround.cells = tileset.allCells();
  surround.surround = true;
  surround.box = {Vec3d::Constant(-1e4), Vec3d::Constant(1e4)};
  surround.geometricError = 2 * kColumns * texel;  // where its texels are smallest, as its domain is twice its cube
  tileset.tiles[0].contents.push_back(surround);
  surround.level = 1;
  surround.geometricError *= 2;
  tileset.tiles[0].contents.push_back(surround);

  scene.contents["0_0"] = contentOf(1, {blockPart(0, 32, 64)});
  scene.contents["1_0"] = contentOf(2, {blockPart(1, 32, 64)});
  scene.contents["all"] = contentOf(3, {blockPart(0, 16, 32), blockPart(1, 16, 32)});
  scene.contents["all"].stepsPerTexel = 2;
  scene.contents["surround"] = contentOf(4, {surroundPart(32, 64)});
  scene.contents["coarse_surround"] = contentOf(5, {surroundPart(16, 32)});
  scene.contents["coarse_surround"].stepsPerTexel = 2;
  return scene;
}

Sums sumsOf(const VolumePart& part) {
  const auto add = [](const std::vector<uint8_t>& bytes, uint64_t& sum, uint64_t& ordered) {
    for (size_t i = 0; i < bytes.size(); ++i) {
      sum += bytes[i];
      ordered += (i % 251 + 1) * bytes[i];
    }
  };
  Sums sums;
  sums.stored = part.storedMacroblocks();
  const auto first = std::find(part.macroblocks.begin(), part.macroblocks.end(), 0u);
  sums.firstStored = static_cast<uint64_t>(first - part.macroblocks.begin());
  for (const uint8_t distance : part.distances) {
    sums.occupied += distance == 0;
    sums.distances += distance;
  }
  add(part.voxelBytes, sums.voxels, sums.voxelsOrdered);
  for (size_t axis = 0; axis < 3; ++axis) add(part.planeBytes[axis], sums.planes[axis], sums.planesOrdered[axis]);
  return sums;
}

}  // namespace tessera::golden
