#include "export/gltf.h"

#include <regex>

#include "base/error.h"
#include "export/atomic_folder.h"
#include "export/glb_file.h"
#include "export/mesh_level.h"
#include "representations/mesh/content/fallback_mesh.h"

namespace tessera {
namespace {

bool isGltfTile(const std::string& name) {
  static const std::regex kNames("(tile_[0-9]+_[0-9]+|background_block)\\.glb");
  return std::regex_match(name, kNames);
}

// A file of ordinary meshes of one or more contents.
class GltfFile {
 public:
  GltfFile(const fs::path& place, const MeshLevel& level)
      : level_(level),
        file_(place),
        meshes_([this](std::span<const std::byte> bytes, uint32_t target) { return file_.addView(bytes, target); },
                level.tileset().tileFromScene()) {}

  void add(const LevelContent& content, const MeshContent& mesh) {
    const std::vector<Bytes> textures = level_.readBaseColours(content, mesh);
    size_t next = 0;
    for (size_t i = 0; i < mesh.parts.size(); ++i) {
      if (mesh.parts[i].patches == 0) continue;
      const size_t view = file_.addView(textures[next++]);
      meshes_.add(mesh.parts[i], {{"bufferView", view}, {"mimeType", "image/png"}}, partName(content, mesh, i));
    }
  }
  uint64_t commit() {
    GltfScene::Json asset = {{"asset", {{"version", "2.0"}, {"generator", "tessera"}}}, {"scene", 0}};
    meshes_.scene().addTo(asset);
    asset["scenes"][0]["extras"]["tessera"] = describeLevel(level_);
    return file_.commit(std::move(asset));
  }

 private:
  const MeshLevel& level_;
  GlbFile file_;
  FallbackMesh meshes_;
};

}  // namespace

GltfExport exportGltf(const fs::path& scene, const fs::path& out, const GltfExportSettings& settings) {
  if (!settings.isSplit && out.extension() != ".glb")
    throw Error(out.string(), "", "is not the name of a binary glTF file", "name a file that ends in .glb");
  const MeshLevel level(scene, settings.level, "gltf");
  std::optional<AtomicFolder> folder;
  std::optional<GltfFile> file;
  if (settings.isSplit) {
    folder.emplace(out, isGltfTile);
  } else {
    file.emplace(out, level);
  }
  GltfExport exported;
  for (const LevelContent& listed : level.contents()) {
    const std::unique_ptr<Content> content = level.read(listed);
    const MeshContent& mesh = contentAs<MeshContent>(*content);
    if (mesh.triangles() == 0) continue;
    if (folder) file.emplace(folder->path() / (listed.name + ".glb"), level);
    file->add(listed, mesh);
    exported.triangles += mesh.triangles();
    ++exported.tiles;
    if (!folder) continue;
    exported.bytesOnDisk += file->commit();
    ++exported.files;
    file.reset();
  }
  if (exported.triangles == 0) throw Error(scene.string(), "", "contains no triangles", "train longer, and bake again");
  if (folder) {
    folder->commit();
  } else {
    exported.bytesOnDisk = file->commit();
    exported.files = 1;
  }
  return exported;
}

}  // namespace tessera
