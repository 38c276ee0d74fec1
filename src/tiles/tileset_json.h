// Encoding and decoding of tileset.json: 3D Tiles 1.1 with the extension TESSERA_scene (docs/tile-format.md).
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "tiles/tileset.h"

namespace tessera {

inline constexpr const char* kSceneExtension = "TESSERA_scene";
inline constexpr int kSceneVersion = 1;

inline constexpr uint32_t kMaxCells = 4096;  // of the grid, along an axis

struct TilesetLimits {
  size_t textBytes = size_t{16} << 20;
  uint32_t tiles = 1 << 16, depth = 64;
  uint32_t contentsOfTile = 64, resources = 1 << 16, coverage = 1 << 16;
};

// Throws Error for violations that settings can cause: of the bounds of `near`, cells and tiles.
void requireWritable(const Tileset& tileset);

// The same tileset gives the same text. Throws Error if it exceeds what readers accept or its `near` is out of bounds,
// both of which settings can cause. CHECKs that it violates no other rule.
std::string encodeTileset(const Tileset& tileset);

// Decodes untrusted text. Returns nothing, with the reason in `reason`, if it is not JSON, has another version,
// violates a rule of the format, or exceeds the limits. In what is returned, all numbers are finite and all indices and
// uris are valid: uris are relative, consist of plain characters and cannot leave the folder (except through symbolic
// links on disk, which scene_folder.h checks).
std::optional<Tileset> decodeTileset(std::string_view text, std::string& reason, const TilesetLimits& limits = {});

// Returns the union of a tile's box and those of its contents: the bounding volume that is stored on disk, which in 3D
// Tiles includes the far box of a background block.
SceneBox enclosingBox(const Tile& tile);
// Returns a box in the tile frame as 3D Tiles stores it: the centre, then the vectors of half the edges along the
// scene's x, y and z (3 numbers each).
std::array<double, 12> boundingBoxNumbers(const Tileset& tileset, const SceneBox& box);

// Returns whether a uri consists of letters, digits, `.`, `_` and `-` between single slashes, has no component that
// begins with a dot, and is at most 255 characters long.
bool isPlainUri(std::string_view uri);

}  // namespace tessera
