// Models of all levels to a tree of tiles on disk.
#include <algorithm>
#include <optional>

#include "representations/hash/bake_hash.h"
#include "tiles/hash_payload.h"

namespace tessera {
namespace {

// Writes the contents of a level.
void bakeLevel(HashModel& model, uint32_t level, const Capture& capture, const BakeHashOptions& options,
               SceneWriter& scene) {
  requireBakeable(model);
  const std::vector<OccupancyBits> seen = findSeenCells(model, capture, options);
  const bool surround = model.space().blocks() > model.space().cells();
  const LevelGroups groups = groupsOfLevel(static_cast<uint32_t>(model.grid().columns),
                                           static_cast<uint32_t>(model.grid().rows), level, surround);
  scene.beginLevel(model.fields().fineGrid().levels.back().resolution);
  for (uint32_t group = 0; group < groups.groups(); ++group) {
    std::vector<uint32_t> blocks;
    for (uint32_t block = 0; block < groups.groupOfBlock.size(); ++block) {
      if (groups.groupOfBlock[block] == group) blocks.push_back(block);
    }
    const HashContent content = bakeHashGroup(model, blocks, seen);
    const Bytes file = encodeHash(content, options.effort);
    if (group < groups.cells.size()) {
      scene.add(groups.cells[group], file, summaryOf(content));
    } else {
      scene.addSurround(file, summaryOf(content));
    }
  }
}

}  // namespace

BakedScene bakeHash(const HashLevelModels& models, uint32_t levels, const Capture& capture, const fs::path& folder,
                    const BakeHashOptions& options) {
  std::optional<SceneWriter> scene;
  const int64_t photos = static_cast<int64_t>(capture.photosIn(Split::train).size());
  for (uint32_t level = 0; level < levels; ++level) {
    BakeHashOptions ofLevel = options;
    ofLevel.onPhoto = [&](int64_t done, int64_t) { options.onPhoto(level * photos + done, levels * photos); };
    ofLevel.stride <<= level;
    if (options.cells > 0) {
      ofLevel.cells = std::max(HashPart::kOccupancyUnit,
                               (options.cells >> level) / HashPart::kOccupancyUnit * HashPart::kOccupancyUnit);
    }
    const std::unique_ptr<HashModel> model = models(level);
    if (level == 0) {
      scene.emplace(folder, capture, model->grid(),
                    SceneDescription{kHashName, model->space().near, options.background.value_or(kHazySky)});
    }
    bakeLevel(*model, level, capture, ofLevel, *scene);
  }
  return scene->commit();
}

}  // namespace tessera
