#include "golden/golden_landscape.h"

#include <algorithm>
#include <cmath>

namespace tessera::golden {
namespace {

constexpr uint32_t kColumns = 2, kRows = 1;
constexpr double kBottom = -0.75, kTop = 0.75;

Tile makeTile(const Tileset& tileset, uint32_t level, const CellRange& cells) {
  Tile tile;
  tile.level = level;
  tile.cells = cells;
  tile.box = tileset.boxFromCells(cells);
  tile.contents.resize(1);
  tile.contents[0].cells = cells;
  tile.contents[0].box = tile.box;
  return tile;
}

// Returns the height of the terrain or building at x, y.
double heightAt(double x, double y) {
  const double fromMiddle = std::abs(std::abs(x) - 1);
  if (fromMiddle < 0.4 && std::abs(y) < 0.3 && std::abs(x) < 2) return x < 0 ? 0.45 : 0.1;
  return -0.45 + 0.12 * noise(1, 1.5 * x, 1.5 * y);
}

}  // namespace

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

double logDensityAt(const Triple<double>& p) {
  return std::clamp(-60 * (p[2] - heightAt(p[0], p[1])), -12.0, 6.0);
}

Triple<double> inScene(const ContentPart& part, const Triple<double>& inDomain) {
  const Triple<double> q = part.contracted ? uncontract(inDomain) : inDomain;
  return {part.centre[0] + part.scale[0] * q[0], part.centre[1] + part.scale[1] * q[1],
          part.centre[2] + part.scale[2] * q[2]};
}

double middle(const ContentPart& part, uint32_t index, uint32_t count) {
  const double h = part.halfDomain();
  return -h + 2 * h * (index + 0.5) / count;
}

Triple<double> placeOfTexel(const ContentPart& part, const Triple<uint32_t>& texel, uint32_t count) {
  return inScene(part, {middle(part, texel[0], count), middle(part, texel[1], count), middle(part, texel[2], count)});
}

Densities::Densities(const ContentPart& part, uint32_t count) : count_(count) {
  values_.reserve(size_t{count} * count * count);
  for (uint32_t z = 0; z < count; ++z) {
    for (uint32_t y = 0; y < count; ++y) {
      for (uint32_t x = 0; x < count; ++x) values_.push_back(logDensityAt(placeOfTexel(part, {x, y, z}, count)));
    }
  }
}

bool Densities::isAnythingIn(const Triple<uint32_t>& first, const Triple<uint32_t>& last) const {
  const uint32_t maximum = count_ - 1;
  bool dense = false, hollow = false;
  for (uint32_t z = first[2]; z <= std::min(last[2], maximum); ++z) {
    for (uint32_t y = first[1]; y <= std::min(last[1], maximum); ++y) {
      for (uint32_t x = first[0]; x <= std::min(last[0], maximum); ++x) {
        dense = dense || at(x, y, z) > -6;
        hollow = hollow || at(x, y, z) < 3;
      }
    }
  }
  return dense && (hollow || first[2] == 0);  // what lies deep below is never visible
}

std::vector<DenseLayer> makeNetwork(uint32_t inputs, const RandomStream& random, uint64_t& next) {
  std::vector<DenseLayer> network;
  for (const uint32_t outputs : {16u, 16u, 3u}) {
    DenseLayer layer{inputs, outputs, {}, {}};
    for (uint32_t i = 0; i < inputs * outputs; ++i) layer.weights.push_back(random.uniform(next++) - 0.5f);
    for (uint32_t i = 0; i < outputs; ++i) layer.biases.push_back(random.uniform(next++) - 0.5f);
    network.push_back(std::move(layer));
    inputs = outputs;
  }
  return network;
}

ByteSums computeSums(const std::vector<uint8_t>& bytes) {
  ByteSums sums;
  for (size_t i = 0; i < bytes.size(); ++i) {
    sums.sum += bytes[i];
    sums.ordered += (i % 251 + 1) * bytes[i];
  }
  return sums;
}

void placeBlock(ContentPart& part, uint32_t column) {
  part.centre = {2.0f * static_cast<float>(column) + 1 - static_cast<float>(kColumns), 0, 0};
  part.low = {part.centre[0] - 1, -1, static_cast<float>(kBottom)};
  part.high = {part.centre[0] + 1, 1, static_cast<float>(kTop)};
}

void placeBackgroundBlock(ContentPart& part) {
  part.scale = {kColumns, kRows, 1};
  part.contracted = part.backgroundBlock = true;
  part.low = {-1e4f, -1e4f, -1e4f};
  part.high = {1e4f, 1e4f, 1e4f};
}

Tileset landscapeTileset(const std::string& representation, uint32_t texels) {
  Tileset tileset;
  tileset.representation = representation;
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
  const double texel = 25 * 2.0 / texels;  // metres
  tileset.geometricError = 100;
  tileset.tiles = {makeTile(tileset, 1, tileset.allCells()), makeTile(tileset, 0, {{0, 0}, {1, 1}}),
                   makeTile(tileset, 0, {{1, 0}, {2, 1}})};
  tileset.tiles[0].geometricError = 2 * texel;
  tileset.tiles[1].geometricError = tileset.tiles[2].geometricError = texel;
  tileset.tiles[0].children = {1, 2};
  TileContent backgroundBlock;
  backgroundBlock.cells = tileset.allCells();
  backgroundBlock.backgroundBlock = true;
  backgroundBlock.box = {Vec3d::Constant(-1e4), Vec3d::Constant(1e4)};
  backgroundBlock.geometricError =
      2 * kColumns *
      texel;  // at the block's face, where its texels are smallest: its domain is twice as wide as its cube
  tileset.tiles[0].contents.push_back(backgroundBlock);
  backgroundBlock.level = 1;
  backgroundBlock.geometricError *= 2;
  tileset.tiles[0].contents.push_back(backgroundBlock);
  return tileset;
}

}  // namespace tessera::golden
