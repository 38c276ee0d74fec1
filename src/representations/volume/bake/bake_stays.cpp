#include "representations/volume/bake/bake_stays.h"

#include <algorithm>

#include "train/residency.h"

namespace tessera {
namespace {

bool has(const std::vector<uint32_t>& stay, uint32_t block) {
  return std::find(stay.begin(), stay.end(), block) != stay.end();
}

}  // namespace

BakeStays::BakeStays(const TiledPhotos& photos, uint32_t cells, uint32_t resident) {
  BlockSets sets{photos.sets, std::vector<double>(photos.sets.size())};
  for (const uint32_t set : photos.setOfTile) ++sets.weights[set];
  Residency::Settings settings;
  settings.blocks = cells;
  settings.resident = resident;
  const Residency residency(sets, settings);
  for (const Residency::Stay& stay : residency.stays()) stays_.push_back(stay.blocks);
  double parts = 0;
  for (size_t set = 0; set < photos.sets.size(); ++set) {
    staysOfSet_.push_back(cover(photos.sets[set], resident));
    if (staysOfSet_.back().size() > 1) parts += sets.weights[set];
  }
  inParts_ = photos.tiles.empty() ? 0 : parts / static_cast<double>(photos.tiles.size());
}

uint32_t BakeStays::bestFor(const std::vector<uint32_t>& blocks) const {
  uint32_t best = 0;
  ptrdiff_t most = -1;
  for (uint32_t stay = 0; stay < stays_.size(); ++stay) {
    const ptrdiff_t there =
        std::count_if(blocks.begin(), blocks.end(), [&](uint32_t block) { return has(stays_[stay], block); });
    if (there > most) {
      most = there;
      best = stay;
    }
  }
  return best;
}

// Greedy: the stay that has most of those that are left.
std::vector<uint32_t> BakeStays::cover(std::vector<uint32_t> blocks, uint32_t resident) {
  std::vector<uint32_t> chosen;
  do {
    uint32_t best = bestFor(blocks);
    const size_t before = blocks.size();
    const auto takeWhatIsThere = [&] {
      std::erase_if(blocks, [&](uint32_t block) { return has(stays_[best], block); });
    };
    takeWhatIsThere();
    if (before > 0 && blocks.size() == before) {
      best = static_cast<uint32_t>(stays_.size());
      stays_.emplace_back(blocks.begin(),
                          blocks.begin() + static_cast<ptrdiff_t>(std::min<size_t>(resident, blocks.size())));
      takeWhatIsThere();
    }
    chosen.push_back(best);
  } while (!blocks.empty());
  return chosen;
}

}  // namespace tessera
