// Fuzzes the tileset decoder: an accepted tileset satisfies the rules, names only plain files, and can be encoded
// again.
#include <cstdlib>

#include "tiles/tileset_json.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  tessera::TilesetLimits limits;
  limits.tiles = 256;
  limits.depth = 16;
  std::string reason;
  const auto tileset = tessera::decodeTileset({reinterpret_cast<const char*>(data), size}, reason, limits);
  if (tileset.has_value() != reason.empty()) std::abort();
  if (!tileset) return 0;
  if (tessera::validationError(*tileset)) std::abort();
  for (const tessera::Tile& tile : tileset->tiles) {
    for (const tessera::TileContent& content : tile.contents) {
      if (!tessera::isPlainUri(content.uri) || content.uri.find("..") == 0) std::abort();
    }
  }
  tessera::coarsestCover(*tileset);
  tessera::childrenFrontToBack(*tileset, 0, {1, 2, 3});
  const std::string text = tessera::encodeTileset(*tileset);
  const auto again = tessera::decodeTileset(text, reason);
  if (!again || tessera::encodeTileset(*again) != text) std::abort();
  return 0;
}
