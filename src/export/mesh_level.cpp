#include "export/mesh_level.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "base/error.h"
#include "base/image_io.h"
#include "representations/mesh/content/mesh_payload.h"
#include "tiles/content_file.h"
#include "tiles/glb.h"
#include "tiles/read_content.h"
#include "tiles/scene_folder.h"

namespace tessera {
namespace {

constexpr uint64_t kMaxTextureFile = uint64_t{1} << 30;  // bytes

// Returns the images that a content's asset names, which are files of their own.
std::vector<std::string> readImageUris(const fs::path& path) {
  std::error_code status;
  const auto length = readJsonLength(readFileStart(path, kGlbStart), fs::file_size(path, status));
  if (!length) return {};
  const Bytes start = readFileStart(path, kGlbStart + std::min<uint64_t>(*length, kMaxContentJson));
  const auto* const text = reinterpret_cast<const char*>(start.data());
  const auto asset = nlohmann::json::parse(text + kGlbStart, text + start.size(), nullptr, false);
  std::vector<std::string> uris;
  if (!asset.is_object() || !asset.contains("images") || !asset["images"].is_array()) return {};
  for (const auto& image : asset["images"]) {
    if (!image.is_object() || !image.contains("uri") || !image["uri"].is_string()) return {};
    uris.push_back(image["uri"].get<std::string>());
  }
  return uris;
}

}  // namespace

MeshLevel::MeshLevel(fs::path scene, uint32_t level, const std::string& format)
    : scene_(std::move(scene)), level_(level) {
  if (!fs::exists(scene_ / "tileset.json") && fs::exists(scene_ / "blocks.json")) {
    throw Error(scene_.string(), "", "is a model, but only baked scenes can be exported",
                "run tessera bake, and export the scene");
  }
  tileset_ = readTileset(scene_);
  if (tileset_.representation != kMeshName) {
    throw Error((scene_ / "tileset.json").string(), "",
                fmt::format("is a scene of {}, which has no triangles", tileset_.representation),
                fmt::format("train with --method mesh, bake that, and export the scene with --format {}", format));
  }
  if (const uint32_t coarsest = coarsestLevel(tileset_); level_ > coarsest) {
    throw Error(scene_.string(), fmt::format("--level {}", level_),
                coarsest == 0 ? "the scene has level 0 only" : fmt::format("the scene has levels 0 to {}", coarsest),
                coarsest == 0 ? "leave it out" : "name one of those");
  }
  listContents();
}

void MeshLevel::listContents() {
  std::vector<size_t> pending = {0};
  while (!pending.empty()) {
    const size_t number = pending.back();
    pending.pop_back();
    const Tile& tile = tileset_.tiles[number];
    if ((tile.level > level_ || !tile.isDrawable()) && !tile.children.empty()) {
      pending.insert(pending.end(), tile.children.rbegin(), tile.children.rend());
      continue;
    }
    for (size_t i = 0; i < tile.contents.size(); ++i) {
      const TileContent& content = tile.contents[i];
      if (content.backgroundBlock) continue;
      contents_.push_back({number, i, fmt::format("tile_{}_{}", content.cells.first[0], content.cells.first[1])});
    }
  }
  // The finest background block: coarser ones that tessera writes have as many triangles, and no ordinary mesh.
  const std::vector<TileContent>& ofRoot = tileset_.root().contents;
  std::optional<size_t> chosen;
  for (size_t i = 0; i < ofRoot.size(); ++i) {
    if (ofRoot[i].backgroundBlock && (!chosen || ofRoot[i].level < ofRoot[*chosen].level)) chosen = i;
  }
  if (chosen) contents_.push_back({0, *chosen, "background_block"});
}

std::unique_ptr<Content> MeshLevel::read(const LevelContent& content) const {
  Resources resources;
  for (const uint32_t number : declared(content).resources) {
    const SharedResource& resource = tileset_.resources[number];
    resources.push_back(readResource(contentPath(scene_, resource.uri), meshCodec(), resource));
  }
  return readVerifiedContent(contentPath(scene_, declared(content).uri), meshCodec(), content.tile, declared(content),
                             resources);
}

std::vector<Bytes> MeshLevel::readBaseColours(const LevelContent& content, const MeshContent& mesh) const {
  const fs::path path = contentPath(scene_, declared(content).uri);
  const std::vector<std::string> uris = readImageUris(path);
  std::vector<Bytes> textures;
  for (const PatchSet& part : mesh.parts) {
    if (part.patches == 0) continue;
    if (textures.size() == uris.size()) {
      throw Error(path.string(), "", "has no ordinary mesh for other programs",
                  "bake the scene again with --fallback 1, which is the default");
    }
    const fs::path uri = fs::path(declared(content).uri).parent_path() / uris[textures.size()];
    const fs::path file = contentPath(scene_, uri.lexically_normal().generic_string());
    Bytes bytes = readFile(file, kMaxTextureFile);
    const auto image = probeImage(bytes);
    if (!image || image->format != ImageInfo::Format::png || !hasItsDigest(file, bytes) ||
        static_cast<uint32_t>(image->width) != part.textureWidth() ||
        static_cast<uint32_t>(image->height) != part.textureHeight()) {
      throw Error(file.string(), "",
                  fmt::format("is not the undamaged PNG of {} × {} pixels that {} needs", part.textureWidth(),
                              part.textureHeight(), path.filename().string()),
                  "copy the scene again, or bake it again");
    }
    textures.push_back(std::move(bytes));
  }
  return textures;
}

std::string partName(const LevelContent& content, const MeshContent& mesh, size_t part) {
  return mesh.parts.size() == 1 ? content.name : fmt::format("{}_part_{}", content.name, part);
}

nlohmann::ordered_json describeLevel(const MeshLevel& level) {
  nlohmann::ordered_json json = {{"name", level.tileset().name}, {"level", level.level()}};
  if (const auto& georeference = level.tileset().georeference) {
    json["georeference"] = {{"latitude", georeference->latitude},
                            {"longitude", georeference->longitude},
                            {"altitude", georeference->altitude}};
  }
  return json;
}

}  // namespace tessera
