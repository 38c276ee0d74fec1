// make_golden volume|hash DIR: writes a golden scene with sums.json and rays.json, against which readers and renderers
// in every language are tested. Run it again only when the format changes, and say so in the commit.
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "golden/golden_hash.h"
#include "golden/golden_rays.h"
#include "golden/golden_volume.h"
#include "representations/hash/content/hash_payload.h"
#include "representations/volume/content/volume_payload.h"
#include "tiles/scene_folder.h"

using namespace tessera;

namespace {

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

template <class Content, class Encode>
void write(const fs::path& root, golden::Scene<Content> scene, const Encode& encode) {
  const SceneFolderWriter writer(root);
  Tileset& tileset = scene.tileset;
  nlohmann::ordered_json sums;
  const auto writeContent = [&](TileContent& content, uint32_t level, const std::string& name) {
    const Bytes bytes = encode(scene.contents.at(name), 9);
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
      write(arguments[2], golden::makeVolumeScene(), encodeVolume);
    } else if (kind == "hash") {
      write(arguments[2], golden::makeHashScene(), encodeHash);
    } else {
      return 2;
    }
  } catch (const Error& error) {
    std::fprintf(stderr, "tessera: error: %s\n", error.what());
    return 1;
  }
  return 0;
}
