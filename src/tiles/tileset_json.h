// tileset.json: 3D Tiles 1.1 with our extension TESSERA_scene (docs/tile-format.md).
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "tiles/tileset.h"

namespace tessera {

inline constexpr const char* kSceneExtension = "TESSERA_scene";
inline constexpr int kSceneVersion = 1;

inline constexpr uint32_t kMostCells = 4096;  // of the grid, along an axis

struct TilesetLimits {
  size_t textBytes = size_t{16} << 20;
  uint32_t tiles = 1 << 16, depth = 64;
  uint32_t contentsOfTile = 64, resources = 1 << 16;
};

// The same tileset gives the same text. Throws Error where it is more than readers take, or its `near` is out of
// bounds: settings can cause that. CHECKs that it breaks no other rule.
std::string encodeTileset(const Tileset& tileset);

// Untrusted text: nothing, and why in `reason`, where it is not JSON, has another version, breaks a rule of the format,
// or is larger than the limits. All that it holds is finite, every index and uri is good: uris are relative, of plain
// characters, and cannot leave the folder (links on the disk apart: scene_folder.h looks at those).
std::optional<Tileset> decodeTileset(std::string_view text, std::string& reason, const TilesetLimits& limits = {});

// A tile's box and those of its contents: what stands on disk as its bounding volume, which in 3D Tiles holds the far
// box of a surround too.
SceneBox enclosingBox(const Tile& tile);
// In the tile frame: centre, then half the edges along x, y, z.
std::array<double, 12> boundingBoxNumbers(const Tileset& tileset, const SceneBox& box);

// Letters, digits, `.`, `_`, `-` between single slashes, no part beginning with a dot, 255 characters at most.
bool isPlainUri(std::string_view uri);

}  // namespace tessera
