// Small scenes for tests: random texels, every rule of the format kept.
#pragma once

#include <string>

#include "base/random.h"
#include "tiles/hash_content.h"
#include "tiles/occupancy_distance.h"
#include "tiles/tileset.h"
#include "tiles/volume_content.h"

namespace tessera::tiles_test {

inline VolumePart madePart(uint64_t seed, uint32_t voxels = 16, uint32_t planes = 24) {
  const RandomStream random(seed, 0x711e5);
  uint64_t next = 0;
  VolumePart part;
  part.voxels = voxels;
  part.planes = planes;
  const uint32_t edge = voxels / VolumePart::kMacroblock, cells = planes / VolumePart::kDistanceCell;
  part.macroblocks.assign(size_t{edge} * edge * edge, VolumePart::kEmpty);
  uint32_t stored = 0;
  for (uint32_t& number : part.macroblocks) {
    if (random.below(next++, 3) > 0) number = stored++;
  }
  part.voxelBytes.resize(size_t{stored} * VolumePart::kMacroblockBytes);
  for (uint8_t& byte : part.voxelBytes) byte = static_cast<uint8_t>(random.below(next++, 256));
  for (auto& plane : part.planeBytes) {
    plane.resize(size_t{planes} * planes * VolumePart::kAttributes);
    for (uint8_t& byte : plane) byte = static_cast<uint8_t>(random.below(next++, 256));
  }
  OccupancyBits occupied(cells);
  for (size_t i = 0; i < occupied.count(); ++i) {
    if (random.below(next++, 4) == 0) occupied.set(i);
  }
  part.distances = chebyshevDistances(occupied);
  return part;
}

inline std::vector<DenseLayer> madeNetwork(uint64_t seed, std::vector<uint32_t> widths) {
  const RandomStream random(seed, 0xc0);
  uint64_t next = 0;
  std::vector<DenseLayer> network;
  for (size_t i = 0; i + 1 < widths.size(); ++i) {
    DenseLayer layer{widths[i], widths[i + 1], {}, {}};
    for (uint32_t k = 0; k < layer.inputs * layer.outputs; ++k) {
      layer.weights.push_back(random.uniform(next++) - 0.5f);
    }
    for (uint32_t k = 0; k < layer.outputs; ++k) layer.biases.push_back(random.uniform(next++) - 0.5f);
    network.push_back(std::move(layer));
  }
  return network;
}

// Side by side along x, cells of edge 2.
template <class Part>
void placeInRow(std::vector<Part>& parts) {
  for (size_t i = 0; i < parts.size(); ++i) {
    parts[i].centre[0] = 2.0f * static_cast<float>(i);
    parts[i].low[0] = parts[i].centre[0] - 1;
    parts[i].high[0] = parts[i].centre[0] + 1;
  }
}

inline VolumeContent madeContent(uint64_t seed, uint32_t parts = 1) {
  VolumeContent content;
  content.network = madeNetwork(seed, {34, 16, 16, 3});
  for (uint32_t i = 0; i < parts; ++i) content.parts.push_back(madePart(seed + 100 * i));
  placeInRow(content.parts);
  return content;
}

struct MadeHash {
  uint32_t lattice = 16, cells = 16, levels = 2, entries = 512;
  LevelWeights weights = LevelWeights::separate;
  bool varies = true;
};

inline HashPart madeHashPart(uint64_t seed, const MadeHash& made, uint32_t columns) {
  const RandomStream random(seed, 0x4a54);
  uint64_t next = 0;
  HashPart part;
  part.lattice = made.lattice;
  part.columns = columns;
  const auto range = [&] {
    const float low = random.uniform(next++) - 1;
    return ByteRange{low, low + 2 * random.uniform(next++)};
  };
  for (uint32_t c = 0; c < columns; ++c) part.ranges.push_back(range());
  const uint32_t edge = made.lattice / HashPart::kMacroblock;
  part.macroblocks.assign(size_t{edge} * edge * edge, HashPart::kEmpty);
  uint32_t stored = 0;
  for (uint32_t& number : part.macroblocks) {
    if (random.below(next++, 3) > 0) number = stored++;
  }
  const auto bytes = [&](size_t count) {
    std::vector<uint8_t> all(count);
    for (uint8_t& byte : all) byte = static_cast<uint8_t>(random.below(next++, 256));
    return all;
  };
  part.cornerBytes = bytes(size_t{stored} * HashPart::kStoredTexels * columns);
  for (uint32_t l = 0; l < made.levels; ++l) {
    HashTable table;
    table.resolution = l == 0 ? 8 : made.lattice << l;
    table.entries = made.entries;
    table.hashed = l > 0;
    for (ByteRange& one : table.ranges) one = range();
    table.bytes = bytes(size_t{table.entries} * HashPart::kFeatures);
    part.tables.push_back(std::move(table));
  }
  OccupancyBits occupied(made.cells);
  for (size_t i = 0; i < occupied.count(); ++i) {
    if (random.below(next++, 20) == 0) occupied.set(i);
  }
  part.occupied = pyramidFromOccupancy(std::move(occupied));
  part.distances = octantDistances(part.occupied);
  return part;
}

// Random, every rule of the format kept.
inline HashContent madeHashContent(uint64_t seed, uint32_t parts = 1, const MadeHash& made = {}) {
  HashContent content;
  content.weights = made.weights;
  content.step = 0.01f;
  content.network = madeNetwork(seed, {23, 16, 16, 3});
  if (!made.varies) content.logits.assign(size_t{made.levels} * content.logitsOfLevel(), 0.25f);
  for (uint32_t i = 0; i < parts; ++i) {
    content.parts.push_back(madeHashPart(seed + 100 * i, made, content.columns()));
  }
  placeInRow(content.parts);
  return content;
}

// Columns × 2 cells, each a leaf; all of them below one root, with two surrounds.
inline Tileset madeTileset(uint32_t columns = 3, bool georeferenced = true) {
  Tileset tileset;
  tileset.name = "made";
  tileset.worldFromScene.rotation << 0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1;
  tileset.worldFromScene.scale = 12.5;
  tileset.worldFromScene.translation = {3, -4, 1.75};
  tileset.sourceFromWorld.topRightCorner<3, 1>() = Vec3d(1, 2, 3);
  if (georeferenced) {
    tileset.georeference = GeoFrame{50.82, -0.14, 31.5, Mat4d::Identity()};
    tileset.georeference->enuFromWorld.topLeftCorner<3, 3>() =
        1.25 * Eigen::AngleAxisd(0.3, Vec3d::UnitZ()).toRotationMatrix();
    tileset.georeference->enuFromWorld.topRightCorner<3, 1>() = Vec3d(-7, 8, 0.1);
  }
  tileset.columns = columns;
  tileset.rows = 2;
  tileset.bottom = -0.25;
  tileset.top = 0.75;
  tileset.background = {0.25f, 0.5f, 0.75f};
  tileset.levels = 2;
  tileset.geometricError = 100;
  tileset.resources = {{"resources/table-0a.bin", "application/octet-stream", 17}};
  Tile root;
  root.level = 1;
  root.cells = tileset.allCells();
  root.box = tileset.box();
  root.geometricError = 0.5;
  const SceneBox far = {Vec3d::Constant(-1000), Vec3d::Constant(1000)};
  root.contents.push_back({"tiles/L1/all-00.glb", root.cells, root.box, false, {0}, 1234});
  root.contents.push_back({"tiles/L1/surround-00.glb", root.cells, far, true, {}, 0, 1, 3.5});
  root.contents.push_back({"tiles/L0/surround-00.glb", root.cells, far, true, {}, 0, 0, 1.75});
  tileset.tiles.push_back(root);
  for (uint32_t j = 0; j < tileset.rows; ++j) {
    for (uint32_t i = 0; i < columns; ++i) {
      Tile tile;
      tile.cells = {{i, j}, {i + 1, j + 1}};
      tile.box = tileset.boxOf(tile.cells);
      tile.box.high.z() = 0.5;
      tile.geometricError = 0.25;
      tile.contents.resize(1);
      tile.contents[0].uri = "tiles/L0/" + std::to_string(i) + "_" + std::to_string(j) + "-00.glb";
      tile.contents[0].cells = tile.cells;
      tile.contents[0].box = tile.box;
      tileset.tiles[0].children.push_back(static_cast<uint32_t>(tileset.tiles.size()));
      tileset.tiles.push_back(std::move(tile));
    }
  }
  return tileset;
}

}  // namespace tessera::tiles_test
