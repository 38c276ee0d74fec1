#include "world/placed_models.h"

#include <fmt/format.h>

#include <cctype>
#include <map>
#include <set>
#include <utility>

#include "base/error.h"
#include "base/log.h"
#include "world/model_files.h"
#include "world/world_text.h"

namespace tessera {
namespace {

constexpr int kModelsOfLargestSize = 4;  // that a world may hold

// Also of Windows, where worlds may have been written.
bool isAbsolutePath(const std::string& name) {
  const bool hasDrive = name.size() > 1 && std::isalpha(static_cast<unsigned char>(name[0])) != 0 && name[1] == ':';
  return hasDrive || name.starts_with('/') || name.starts_with('\\');
}

void requireLocalFiles(const WorldModel& model, const fs::path& worldFile, const std::string& place) {
  const std::string& own = model.files[0];
  if (isOfNetwork(own)) {
    throw Error(worldFile.string(), place,
                fmt::format("'{}' is on the network, and only browsers fetch models", own.substr(0, 200)),
                "download the model and name its file, or open the world with tessera serve");
  }
  for (const std::string& name : model.files) {
    if (isOfNetwork(name) || !isAbsolutePath(name)) continue;
    throw Error(worldFile.string(), place, fmt::format("'{}' is an absolute path", name.substr(0, 200)),
                "name the file by its path relative to the folder of the world");
  }
}

// Equal for models of the same files.
std::pair<std::string, std::set<std::string>> modelKey(const WorldModel& model) {
  std::set<std::string> others;
  for (size_t i = 1; i < model.files.size(); ++i) others.insert(plainPath(model.files[i]));
  return {plainPath(model.files[0]), std::move(others)};
}

Model readWith(ModelFiles& files, const WorldModel& model, const ModelLimits& limits) {
  const ModelFileReader reader = [&](const std::string& path) { return files.read(path); };
  try {
    Model read = readModel(plainPath(model.files[0]), reader, limits);
    files.requireSmallFiles();
    return read;
  } catch (const Error&) {
    files.requireSmallFiles();  // a file that is too large explains what else is wrong
    throw;
  }
}

// Counts what the models of a world hold together.
class WorldTotals {
 public:
  WorldTotals(const fs::path& worldFile, const ModelLimits& limits) : worldFile_(worldFile), limits_(limits) {}

  void add(const Model& model, const std::string& place) {
    triangles_ += model.corners.size() / 3;
    for (const ImageU8& texture : model.textures) texels_ += static_cast<int64_t>(texture.pixelCount());
    const size_t triangles = kModelsOfLargestSize * limits_.triangles;
    const int64_t texels = kModelsOfLargestSize * limits_.texturePixels;
    if (triangles_ > triangles) refuse(place, fmt::format("{} triangles", triangles), "keep fewer, or simpler models");
    if (texels_ > texels) {
      refuse(place, fmt::format("{} texels of textures", texels), "keep fewer models, or make their textures smaller");
    }
  }

 private:
  [[noreturn]] void refuse(const std::string& place, const std::string& maximum, const std::string& remedy) const {
    throw Error(worldFile_.string(), place, "with those before it has more than " + maximum, remedy);
  }

  const fs::path& worldFile_;
  const ModelLimits& limits_;
  size_t triangles_ = 0;
  int64_t texels_ = 0;
};

}  // namespace

PlacedModels readPlacedModels(const World& world, const fs::path& worldFile, const ModelLimits& limits) {
  PlacedModels all;
  std::map<std::pair<std::string, std::set<std::string>>, size_t> numbers;
  WorldTotals totals(worldFile, limits);
  const FileIndex embedded = indexEmbedded(world);
  const fs::path folder = fs::absolute(worldFile).parent_path();
  for (size_t i = 0; i < world.models.size(); ++i) {
    const WorldModel& model = world.models[i];
    if (!model.isVisible) continue;
    const std::string place = fmt::format("models[{}].files", i);
    requireLocalFiles(model, worldFile, place);
    const auto [number, isNew] = numbers.try_emplace(modelKey(model), all.models.size());
    if (isNew) {
      ModelFiles files(embedded, model, folder, limits.fileBytes);
      const Model& read = all.models.emplace_back(readWith(files, model, limits));
      for (const std::string& lacking : read.lacking) {
        warn("{}: '{}' is missing or is neither JPEG nor PNG: the model is shown without it", model.files[0], lacking);
      }
      totals.add(read, place);
    }
    all.placed.push_back({number->second, model.position, model.rotation, model.scale});
  }
  return all;
}

}  // namespace tessera
