#include "export/unreal.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <regex>

#include "base/error.h"
#include "base/image_io.h"
#include "export/atomic_folder.h"
#include "export/dds.h"
#include "export/glb_file.h"
#include "export/hlsl_decoder.h"
#include "export/mesh_level.h"
#include "representations/mesh/content/fallback_mesh.h"
#include "representations/mesh/content/infer_maps.h"
#include "tiles/bc4.h"

namespace tessera {
namespace {

using UnrealJson = nlohmann::ordered_json;

constexpr double kCentimetres = 100;  // per metre: Unreal's unit, by which it multiplies positions of glTF
constexpr size_t kMaps = kMeshFeatures + 1;

bool isUnrealFile(const std::string& name) {
  static const std::regex kNames(
      "scene\\.json|import_scene\\.py|decoder_[0-9]+\\.(ush|hlsl|json)|"
      "(tile_[0-9]+_[0-9]+|background_block)(_part_[0-9]+)?(\\.glb|_(feature_[0-7]|opacity)\\.(dds|png))");
  return std::regex_match(name, kNames);
}

std::string mapName(size_t map) {
  return map < kMeshFeatures ? fmt::format("feature_{}", map) : "opacity";
}

// Returns the BC4 blocks of a map: of a feature, every other block of a BC5 texture.
std::vector<uint8_t> mapBlocks(const PatchSet& part, size_t map) {
  if (map == kMeshFeatures) return part.opacityBlocks;
  const std::vector<uint8_t>& both = part.featureBlocks[map / 2];
  std::vector<uint8_t> blocks;
  blocks.reserve(both.size() / 2);
  for (size_t at = map % 2 * PatchSet::kBc4Bytes; at < both.size(); at += PatchSet::kBc5Bytes)
    blocks.insert(blocks.end(), both.begin() + static_cast<ptrdiff_t>(at),
                  both.begin() + static_cast<ptrdiff_t>(at + PatchSet::kBc4Bytes));
  return blocks;
}

// glTF's axes: (x, y, z) of the tile frame becomes (x, z, -y).
Similarity yUpFromScene(const Tileset& tileset) {
  Similarity turned = tileset.tileFromScene();
  Mat3d yUpFromTile;
  yUpFromTile << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  turned.rotation = yUpFromTile * turned.rotation;
  turned.translation = yUpFromTile * turned.translation;
  return turned;
}

class UnrealFolder {
 public:
  UnrealFolder(const fs::path& root, const MeshLevel& level)
      : root_(root), level_(level), directions_(sceneFromUnreal(level.tileset().tileFromScene())) {}

  void add(const PatchSet& part, const std::string& name) {
    UnrealJson json = {{"name", name}, {"mesh", name + ".glb"}, {"triangles", part.triangles()}};
    json["location"] = addMesh(part, name);
    json["texture_size"] = {part.textureWidth(), part.textureHeight()};
    for (size_t map = 0; map < kMaps; ++map) {
      const std::string file = name + "_" + mapName(map);
      json["maps"].push_back(file + ".dds");
      json["images"].push_back(file + ".png");
      addMap(part, map, file);
    }
    for (const FeatureRange& range : part.ranges) {
      json["low"].push_back(range.low);
      json["span"].push_back(range.high - range.low);
    }
    json["decoder"] = findDecoder(part.decoder);
    parts_.push_back(std::move(json));
    exported_.triangles += part.triangles();
    ++exported_.parts;
  }

  UnrealExport finish() {
    UnrealJson json = {{"format", "tessera-unreal"}, {"version", 1}};
    json.update(describeLevel(level_));
    json["axes"] = "X east, Y south, Z up, in centimetres";
    json["decoders"] = UnrealJson::array();
    for (size_t i = 0; i < decoders_.size(); ++i) {
      const std::string name = fmt::format("decoder_{}", i);
      json["decoders"].push_back(
          {{"custom_node", name + ".hlsl"}, {"functions", name + ".ush"}, {"weights", name + ".json"}});
      write(name + ".hlsl", writeHlslStatements(decoders_[i], directions_));
      write(name + ".ush", writeHlslFunctions(decoders_[i], directions_));
      write(name + ".json", describeDecoder(decoders_[i], directions_).dump(1) + "\n");
    }
    json["parts"] = std::move(parts_);
    write("import_scene.py", kUnrealScript);
    write("scene.json", json.dump(1) + "\n");
    exported_.decoders = static_cast<uint32_t>(decoders_.size());
    return exported_;
  }

 private:
  void write(const std::string& name, const std::string& text) {
    writeFileAtomically(root_ / name, text, true);
    exported_.bytesOnDisk += text.size();
  }
  void write(const std::string& name, const Bytes& bytes) {
    writeFileAtomically(root_ / name, bytes, true);
    exported_.bytesOnDisk += bytes.size();
  }

  // Writes the triangles relative to a place and returns it, in Unreal's axes and unit. Importers may apply the
  // transform of a node or not, so there is none.
  UnrealJson addMesh(const PatchSet& part, const std::string& name) {
    GlbFile file(root_ / (name + ".glb"));
    FallbackMesh mesh([&](std::span<const std::byte> bytes, uint32_t target) { return file.addView(bytes, target); },
                      yUpFromScene(level_.tileset()));
    mesh.add(part, nullptr, name);
    const GltfScene& scene = mesh.scene();
    UnrealJson node = scene.nodes[0];
    const UnrealJson at = node["translation"];
    node.erase("translation");
    exported_.bytesOnDisk += file.commit({{"asset", {{"version", "2.0"}, {"generator", "tessera"}}},
                                          {"scene", 0},
                                          {"scenes", {{{"nodes", {0}}}}},
                                          {"nodes", {node}},
                                          {"meshes", scene.meshes},
                                          {"accessors", scene.accessors}});
    return {kCentimetres * at[0].get<double>(), kCentimetres * at[2].get<double>(), kCentimetres * at[1].get<double>()};
  }

  void addMap(const PatchSet& part, size_t map, const std::string& file) {
    const std::vector<uint8_t> blocks = mapBlocks(part, map);
    write(file + ".dds", encodeBc4Dds(blocks, part.textureWidth(), part.textureHeight()));
    ImageU8 image(static_cast<int>(part.textureWidth()), static_cast<int>(part.textureHeight()), 1);
    image.pixels = decodeBc4Image(blocks, part.textureWidth(), part.textureHeight());
    write(file + ".png", encodePng(image));
  }

  size_t findDecoder(const std::vector<DenseLayer>& decoder) {
    const auto same = std::find(decoders_.begin(), decoders_.end(), decoder);
    if (same != decoders_.end()) return static_cast<size_t>(same - decoders_.begin());
    decoders_.push_back(decoder);
    return decoders_.size() - 1;
  }

  fs::path root_;
  const MeshLevel& level_;
  Mat3d directions_;
  UnrealJson parts_ = UnrealJson::array();
  std::vector<std::vector<DenseLayer>> decoders_;
  UnrealExport exported_;
};

// Returns the content with all of its maps.
MeshContent readWithMaps(const MeshLevel& level, const LevelContent& listed, int threads) {
  MeshContent mesh = contentAs<MeshContent>(*level.read(listed));
  inferMapsOnCpu(mesh, threads);
  return mesh;
}

}  // namespace

UnrealExport exportUnreal(const fs::path& scene, const fs::path& out, const UnrealExportSettings& settings) {
  const MeshLevel level(scene, settings.level, "unreal");
  AtomicFolder folder(out, isUnrealFile);
  UnrealFolder files(folder.path(), level);
  for (const LevelContent& listed : level.contents()) {
    const MeshContent mesh = readWithMaps(level, listed, settings.threads);
    for (size_t i = 0; i < mesh.parts.size(); ++i)
      if (mesh.parts[i].patches > 0) files.add(mesh.parts[i], partName(listed, mesh, i));
  }
  const UnrealExport exported = files.finish();
  if (exported.triangles == 0) throw Error(scene.string(), "", "contains no triangles", "train longer, and bake again");
  folder.commit();
  return exported;
}

}  // namespace tessera
