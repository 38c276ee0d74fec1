// make_golden volume|hash|mesh DIR: writes a golden scene with sums.json and rays.json, against which readers and
// renderers in every language are tested. Run it again only when the format changes, and say so in the commit.
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/image_io.h"
#include "golden/golden_hash.h"
#include "golden/golden_mesh.h"
#include "golden/golden_rays.h"
#include "golden/golden_volume.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/mesh/content/fallback_mesh.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/volume/content/volume_payload.h"
#include "tiles/scene_folder.h"

using namespace tessera;

namespace {

constexpr int kEffort = 9;

// Formats one ray per line.
std::string raysToJson(const std::vector<golden::ExpectedRay>& rays) {
  const auto rounded = [](double x) { return std::round(1e9 * x) / 1e9; };
  std::string text;
  for (const golden::ExpectedRay& ray : rays) {
    const nlohmann::ordered_json line = {
        {"level", ray.level},
        {"origin", {ray.origin.x(), ray.origin.y(), ray.origin.z()}},
        {"direction", {ray.direction.x(), ray.direction.y(), ray.direction.z()}},
        {"colour", {rounded(ray.colour[0]), rounded(ray.colour[1]), rounded(ray.colour[2])}},
        {"opacity", rounded(ray.opacity)},
        {"distance", rounded(ray.distance)}};
    text += (text.empty() ? "[\n " : ",\n ") + line.dump();
  }
  return text + "\n]\n";
}

// Returns a texture for the ordinary mesh of a part: a colour for each patch, with the part's opacity.
ImageU8 baseColourTexture(const PatchSet& part) {
  const uint32_t edge = part.patchEdge, across = part.patchesAcross();
  ImageU8 texture(static_cast<int>(part.textureWidth()), static_cast<int>(part.textureHeight()), 4);
  for (uint32_t patch = 0; patch < part.patches; ++patch) {
    for (uint32_t y = 0; y < edge; ++y)
      for (uint32_t x = 0; x < edge; ++x) {
        uint8_t* const texel =
            texture.at(static_cast<int>(patch % across * edge + x), static_cast<int>(patch / across * edge + y));
        for (uint32_t c = 0; c < 3; ++c) texel[c] = static_cast<uint8_t>(64 + (patch * (c + 1) * 37 + 8 * x) % 160);
        const MeshTexel mixed = mixTexels(part, patch, static_cast<float>(x), static_cast<float>(y));
        texel[3] = static_cast<uint8_t>(255 * mixed.opacity + 0.5f);
      }
  }
  return texture;
}

// Encodes a content with an ordinary mesh for other programs, whose textures become resources of the scene.
Bytes encodeWithFallback(const MeshContent& mesh, const std::string& name, const SceneFolderWriter& writer,
                         Tileset& tileset) {
  ContentFileWriter file;
  FallbackMesh fallback(file, tileset.tileFromScene());
  for (size_t i = 0; i < mesh.parts.size(); ++i) {
    const Bytes png = encodePng(baseColourTexture(mesh.parts[i]));
    const std::string uri = writer.addResource(name + "_" + std::to_string(i), "png", png);
    tileset.resources.push_back({uri, "image/png", png.size()});
    fallback.add(mesh.parts[i], pngAt("../../" + uri));
  }
  return encodeMesh(mesh, std::move(file), fallback.scene());
}

// `encode`: returns the file of a content, by its name.
template <class Content, class Encode>
void write(const fs::path& root, golden::Scene<Content> scene, const Encode& encode) {
  const SceneFolderWriter writer(root);
  Tileset& tileset = scene.tileset;
  nlohmann::ordered_json sums;
  const auto writeContent = [&](TileContent& content, uint32_t level, const std::string& name) {
    const Bytes bytes = encode(scene.contents.at(name), name, writer, tileset);
    content.uri = writer.addContent(level, name, bytes);
    content.bytes = bytes.size();
    for (const auto& part : scene.contents.at(name).parts)
      sums[content.uri].push_back(golden::toJson(golden::computeSums(part)));
  };
  writeContent(tileset.tiles[0].contents[0], 1, "all");
  writeContent(tileset.tiles[0].contents[1], 0, "background_block");
  writeContent(tileset.tiles[0].contents[2], 1, "coarse_background_block");
  writeContent(tileset.tiles[1].contents[0], 0, "0_0");
  writeContent(tileset.tiles[2].contents[0], 0, "1_0");
  writer.commit(tileset);
  writeFileAtomically(root / "sums.json", sums.dump(1) + "\n");
  writeFileAtomically(root / "rays.json", raysToJson(golden::makeRays(scene)));
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 3) return 2;
  try {
    const std::string kind = arguments[1];
    if (kind == "volume") {
      write(arguments[2], golden::makeVolumeScene(),
            [](const VolumeContent& content, auto&&...) { return encodeVolume(content, kEffort); });
    } else if (kind == "hash") {
      write(arguments[2], golden::makeHashScene(),
            [](const HashContent& content, auto&&...) { return encodeHash(content, kEffort); });
    } else if (kind == "mesh") {
      write(arguments[2], golden::makeMeshScene(), encodeWithFallback);
    } else {
      return 2;
    }
  } catch (const Error& error) {
    std::fprintf(stderr, "tessera: error: %s\n", error.what());
    return 1;
  }
  return 0;
}
