#include "tiles/scene_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cctype>
#include <cstring>
#include <regex>
#include <set>

#include "base/check.h"
#include "base/error.h"
#include "base/random.h"
#include "tiles/tileset_json.h"

namespace tessera {
namespace {

static_assert(std::endian::native == std::endian::little);  // for digests

// Returns a 64-bit digest, which suffices against accidental collisions but not against forgery.
std::string computeDigest(std::span<const std::byte> bytes) {
  uint64_t digest = mix64(bytes.size());
  for (size_t at = 0; at < bytes.size(); at += 8) {
    uint64_t word = 0;
    std::memcpy(&word, bytes.data() + at, std::min<size_t>(8, bytes.size() - at));
    digest = mix64(digest ^ word);
  }
  return fmt::format("{:016x}", digest);
}

void checkName(const std::string& name) {
  CHECK(!name.empty());
  for (const char c : name) CHECK((std::isalnum(static_cast<unsigned char>(c)) || c == '_'));
}

std::set<std::string> collectUris(const Tileset& tileset) {
  std::set<std::string> uris;
  for (const SharedResource& resource : tileset.resources) uris.insert(resource.uri);
  for (const Tile& tile : tileset.tiles) {
    for (const TileContent& content : tile.contents) uris.insert(content.uri);
  }
  return uris;
}

// Returns whether a name ends in -<digest>.<extension>, as all names written here do, or is such a file partially
// written.
bool isOurs(const std::string& file) {
  static const std::regex kName("[A-Za-z0-9_]+-[0-9a-f]{16}\\.[A-Za-z0-9_]+(\\.partial-[0-9]+)?");
  return std::regex_match(file, kName);
}

// Removes files written by this class that the tileset does not refer to: those of an older scene or of a killed run.
void removeOthers(const fs::path& root, const std::set<std::string>& uris) {
  for (const char* folder : {"tiles", "resources"}) {
    std::error_code status;
    std::vector<fs::path> others;
    for (const auto& entry : fs::recursive_directory_iterator(root / folder, status)) {
      if (entry.is_regular_file(status) && isOurs(entry.path().filename().string()) &&
          !uris.contains(entry.path().lexically_relative(root).generic_string())) {
        others.push_back(entry.path());
      }
    }
    for (const fs::path& other : others) fs::remove(other, status);
  }
}

void requireFiles(const fs::path& root, const Tileset& tileset) {
  for (const std::string& uri : collectUris(tileset)) {
    std::error_code status;
    if (!fs::is_regular_file(contentPath(root, uri), status)) {
      throw Error((root / "tileset.json").string(), uri, "there is no such file in the scene", "bake the scene again");
    }
  }
}

}  // namespace

std::string SceneFolderWriter::addContent(uint32_t level, const std::string& name,
                                          std::span<const std::byte> bytes) const {
  checkName(name);
  const std::string uri = fmt::format("tiles/L{}/{}-{}.glb", level, name, computeDigest(bytes));
  writeFileAtomically(root_ / uri, bytes, true);
  return uri;
}

std::string SceneFolderWriter::addResource(const std::string& name, const std::string& extension,
                                           std::span<const std::byte> bytes) const {
  checkName(name);
  checkName(extension);
  const std::string uri = fmt::format("resources/{}-{}.{}", name, computeDigest(bytes), extension);
  writeFileAtomically(root_ / uri, bytes, true);
  return uri;
}

void SceneFolderWriter::commit(const Tileset& tileset) const {
  const std::string text = encodeTileset(tileset);
  requireFiles(root_, tileset);
  writeFileAtomically(root_ / "tileset.json", text, true);
  removeOthers(root_, collectUris(tileset));
}

Tileset readTileset(const fs::path& folder) {
  const fs::path path = folder / "tileset.json";
  std::string reason;
  const TilesetLimits limits;
  auto tileset = decodeTileset(readTextFile(path, limits.textBytes), reason, limits);
  if (!tileset) throw Error(path.string(), "", reason, "bake the scene again");
  requireFiles(folder, *tileset);
  return std::move(*tileset);
}

bool hasItsDigest(const fs::path& file, std::span<const std::byte> bytes) {
  const std::string name = file.filename().string();
  if (!isOurs(name)) return true;
  constexpr size_t kDigits = 16;
  return name.compare(name.rfind('-') + 1, kDigits, computeDigest(bytes)) == 0;
}

fs::path contentPath(const fs::path& folder, const std::string& uri) {
  auto path = isPlainUri(uri) ? resolveInside(folder, uri) : std::nullopt;
  if (!path) throw Error(folder.string(), uri, "leads out of the scene's folder", "bake the scene again");
  return std::move(*path);
}

}  // namespace tessera
