#include "representations/volume/bake/bake_residency_schedule.h"

#include <algorithm>

#include "train/residency.h"

namespace tessera {
namespace {

bool has(const std::vector<uint32_t>& residentSet, uint32_t block) {
  return std::find(residentSet.begin(), residentSet.end(), block) != residentSet.end();
}

}  // namespace

BakeResidencySchedule::BakeResidencySchedule(const TiledPhotos& photos, uint32_t cells, uint32_t resident) {
  BlockSets sets{photos.sets, std::vector<double>(photos.sets.size())};
  for (const uint32_t set : photos.setOfTile) ++sets.weights[set];
  Residency::Settings settings;
  settings.blocks = cells;
  settings.resident = resident;
  const Residency residency(sets, settings);
  for (const Residency::ResidentSet& residentSet : residency.residentSets())
    residentSets_.push_back(residentSet.blocks);
  double parts = 0;
  for (size_t set = 0; set < photos.sets.size(); ++set) {
    residentSetsForSet_.push_back(cover(photos.sets[set], resident));
    if (residentSetsForSet_.back().size() > 1) parts += sets.weights[set];
  }
  inParts_ = photos.tiles.empty() ? 0 : parts / static_cast<double>(photos.tiles.size());
}

uint32_t BakeResidencySchedule::bestFor(const std::vector<uint32_t>& blocks) const {
  uint32_t best = 0;
  ptrdiff_t maximum = -1;
  for (uint32_t residentSet = 0; residentSet < residentSets_.size(); ++residentSet) {
    const ptrdiff_t resident = std::count_if(blocks.begin(), blocks.end(),
                                             [&](uint32_t block) { return has(residentSets_[residentSet], block); });
    if (resident > maximum) {
      maximum = resident;
      best = residentSet;
    }
  }
  return best;
}

// Greedy set cover: repeatedly takes the resident set that contains the most of the remaining blocks.
std::vector<uint32_t> BakeResidencySchedule::cover(std::vector<uint32_t> blocks, uint32_t resident) {
  std::vector<uint32_t> chosen;
  do {
    uint32_t best = bestFor(blocks);
    const size_t before = blocks.size();
    const auto removeCovered = [&] {
      std::erase_if(blocks, [&](uint32_t block) { return has(residentSets_[best], block); });
    };
    removeCovered();
    if (before > 0 && blocks.size() == before) {
      best = static_cast<uint32_t>(residentSets_.size());
      residentSets_.emplace_back(blocks.begin(),
                                 blocks.begin() + static_cast<ptrdiff_t>(std::min<size_t>(resident, blocks.size())));
      removeCovered();
    }
    chosen.push_back(best);
  } while (!blocks.empty());
  return chosen;
}

}  // namespace tessera
