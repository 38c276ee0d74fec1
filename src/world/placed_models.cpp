#include "world/placed_models.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "base/error.h"
#include "base/log.h"
#include "world/world_text.h"

namespace tessera {
namespace {

constexpr size_t kMaxTrianglesOfWorld = 4 * ModelLimits().triangles;

std::string plainPath(const std::string& path) {
  std::string plain = path;
  std::replace(plain.begin(), plain.end(), '\\', '/');
  return fs::path(plain).lexically_normal().generic_string();
}

// Returns the embedded file of this name, or of one that ends in the same file name among those of the model.
const Bytes* findEmbedded(const World& world, const WorldModel& model, const std::string& path) {
  const fs::path requested = plainPath(path);
  const Bytes* alike = nullptr;
  for (const auto& [name, bytes] : world.files) {
    const fs::path plain = plainPath(name);
    if (plain == requested) return &bytes;
    const bool isOwn = std::find(model.files.begin(), model.files.end(), name) != model.files.end();
    if (isOwn && plain.filename() == requested.filename()) alike = &bytes;
  }
  return alike;
}

std::optional<Bytes> readFileOfModel(const World& world, const WorldModel& model, const fs::path& folder,
                                     const std::string& path) {
  if (const Bytes* embedded = findEmbedded(world, model, path)) return *embedded;
  // Files that only the model names must lie in the folder: models come from anywhere.
  const auto isNamed = [&](const std::string& name) { return plainPath(name) == plainPath(path); };
  fs::path file = folder / path;
  if (std::none_of(model.files.begin(), model.files.end(), isNamed)) {
    const std::optional<fs::path> inside = resolveInside(folder, path);
    if (!inside) return std::nullopt;
    file = *inside;
  }
  std::error_code status;
  if (!fs::is_regular_file(file, status) || fs::file_size(file, status) > ModelLimits().fileBytes) return std::nullopt;
  return readFile(file, ModelLimits().fileBytes);
}

}  // namespace

PlacedModels readPlacedModels(const World& world, const fs::path& worldFile) {
  PlacedModels all;
  std::map<std::vector<std::string>, size_t> numbers;
  size_t triangles = 0;
  for (size_t i = 0; i < world.models.size(); ++i) {
    const WorldModel& model = world.models[i];
    if (!model.isVisible) continue;
    const std::string place = fmt::format("models[{}].files", i);
    if (isOfNetwork(model.files[0])) {
      throw Error(worldFile.string(), place,
                  fmt::format("'{}' is on the network, and only browsers fetch models", model.files[0].substr(0, 200)),
                  "download the model and name its file, or open the world with tessera serve");
    }
    const auto [number, isNew] = numbers.try_emplace(model.files, all.models.size());
    if (isNew) {
      const fs::path folder = fs::absolute(worldFile).parent_path();
      const ModelFileReader reader = [&](const std::string& path) {
        return readFileOfModel(world, model, folder, path);
      };
      const Model& read = all.models.emplace_back(readModel(plainPath(model.files[0]), reader));
      for (const std::string& lacking : read.lacking) {
        warn("{}: '{}' is missing or is neither JPEG nor PNG: the model is shown without it", model.files[0], lacking);
      }
      triangles += read.corners.size() / 3;
      if (triangles > kMaxTrianglesOfWorld) {
        throw Error(worldFile.string(), place,
                    fmt::format("with those before it has more than {} triangles", kMaxTrianglesOfWorld),
                    "keep fewer, or simpler models");
      }
    }
    all.placed.push_back({number->second, model.position, model.rotation, model.scale});
  }
  return all;
}

}  // namespace tessera
