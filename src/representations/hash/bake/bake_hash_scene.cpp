// Bakes the models of all levels to the contents of a scene.
#include <algorithm>

#include "bake/level_baker.h"
#include "bake/levels.h"
#include "raymarch/bake/part_summary.h"
#include "representations/hash/bake/bake_hash.h"
#include "representations/hash/content/hash_payload.h"

namespace tessera {
namespace {

class HashBaker final : public LevelBaker<HashModel> {
 public:
  HashBaker(HashLevelModels models, uint32_t levels, const HashBakeSettings& settings)
      : LevelBaker(std::move(models), levels), settings_(settings) {}

 protected:
  SceneDescription describe(const HashModel& finest) const override {
    return {"hash", finest.grid(), finest.space().near, kHazySky};
  }

  void bakeLevel(HashModel& model, uint32_t level, const Capture& capture, const BakeOptions& options,
                 ContentSink& sink) override {
    requireBakeable(model);
    BakeHashOptions levelOptions{options, settings_};
    if (settings_.cells > 0) {
      levelOptions.cells = std::max(HashPart::kOccupancyUnit,
                                    (settings_.cells >> level) / HashPart::kOccupancyUnit * HashPart::kOccupancyUnit);
    }
    const std::vector<OccupancyBits> seen = findSeenCells(model, capture, levelOptions);
    const bool backgroundBlock = model.space().blocks() > model.space().cells();
    const LevelGroups groups = groupsOfLevel(static_cast<uint32_t>(model.grid().columns),
                                             static_cast<uint32_t>(model.grid().rows), level, backgroundBlock);
    for (uint32_t group = 0; group < groups.groups(); ++group) {
      std::vector<uint32_t> blocks;
      for (uint32_t block = 0; block < groups.groupOfBlock.size(); ++block) {
        if (groups.groupOfBlock[block] == group) blocks.push_back(block);
      }
      const HashContent content = bakeHashGroup(model, blocks, seen);
      const std::optional<CellRange> groupCells =
          group < groups.cells.size() ? std::optional(groups.cells[group]) : std::nullopt;
      sink.add(level, groupCells, encodeHash(content, options.effort),
               partSummary(content, content.parts.at(0).tables.back().resolution));
    }
  }

 private:
  HashBakeSettings settings_;
};

}  // namespace

std::unique_ptr<Baker> makeHashBaker(HashLevelModels models, uint32_t levels, const HashBakeSettings& settings) {
  return std::make_unique<HashBaker>(std::move(models), levels, settings);
}

BakedScene bakeHash(const HashLevelModels& models, uint32_t levels, const Capture& capture, const fs::path& folder,
                    const BakeHashOptions& options) {
  return bakeScene(*makeHashBaker(models, levels, options), capture, folder, options);
}

}  // namespace tessera
