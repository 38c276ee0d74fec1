#include "pipeline/result_digests.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <set>

#include "base/file_digest.h"
#include "pipeline/stage.h"

namespace tessera {

std::string photosDigest(const std::vector<ListedPhoto>& photos) {
  std::string text;
  for (const ListedPhoto& photo : photos) text += fmt::format("{} {}\n", photo.name, fileDigest(photo.file));
  return textDigest(text);
}

std::string leftOutDigest(const std::vector<LeftOutPhoto>& photos) {
  std::string text;
  for (const LeftOutPhoto& photo : photos) text += fmt::format("{}\n{}\n", photo.name, photo.reason);
  return textDigest(text);
}

std::string modelDigest(const fs::path& model) {
  const fs::path file = model / "manifest.json";
  std::error_code status;
  if (!fs::exists(file, status)) return "";
  std::string text;
  for (const char* name : {"manifest.json", "config.toml", "blocks.json"}) text += fileDigest(model / name) + "\n";
  const auto manifest = nlohmann::json::parse(readTextFile(file), nullptr, false);
  if (manifest.is_object() && manifest.contains("files") && manifest["files"].is_array()) {
    for (const auto& checkpoint : manifest["files"])
      if (checkpoint.is_string()) text += fileDigest(model / checkpoint.get<std::string>()) + "\n";
  }
  // Coarser levels of detail are models of their own, whose manifests name their checkpoints.
  std::set<fs::path> levels;
  for (const fs::directory_entry& level : fs::directory_iterator(model / "levels", status)) levels.insert(level.path());
  for (const fs::path& level : levels) text += fileDigest(level / "manifest.json") + "\n";
  return textDigest(text);
}

std::string sceneDigest(const fs::path& scene) {
  const fs::path file = scene / "tileset.json";
  std::error_code status;
  return fs::exists(file, status) ? fileDigest(file) : "";
}

}  // namespace tessera
