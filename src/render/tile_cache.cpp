#include "render/tile_cache.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/check.h"
#include "base/error.h"
#include "tiles/hash_content.h"
#include "tiles/volume_content.h"

namespace tessera {

template <class Content>
TileCache<Content>::TileCache(const TileTree& tree, uint64_t budgetBytes, TileSource<Content> source)
    : budget_(budgetBytes), source_(std::move(source)) {
  tree.check();
  std::vector<int> pinned = tree.coarsest();
  if (tree.surround >= 0) pinned.push_back(tree.surround);
  uint64_t bytes = 0;
  for (const int tile : pinned) bytes += bytesOf(tile);
  if (bytes > budget_) {
    throw Error(source_.folder, "",
                fmt::format("its coarsest level takes {} bytes of memory, the budget is {}", bytes, budget_),
                fmt::format("allow at least {:.4g} MiB", static_cast<double>(bytes) / 1048576 * 1.0001));
  }
  for (const int tile : pinned) insert(tile, true);
}

template <class Content>
const Content* TileCache<Content>::find(int tile) {
  const auto found = contents_.find(tile);
  if (found == contents_.end()) return nullptr;
  ++statistics_.hits;
  uses_.splice(uses_.begin(), uses_, found->second.use);
  return &found->second.content;
}

template <class Content>
void TileCache<Content>::load(std::span<const int> tiles) {
  const auto stays = [&](int tile) {
    return contents_.at(tile).pinned || std::find(tiles.begin(), tiles.end(), tile) != tiles.end();
  };
  for (const int tile : tiles) {
    if (holds(tile)) continue;
    while (statistics_.bytes + bytesOf(tile) > budget_) {
      const auto oldest = std::find_if_not(uses_.rbegin(), uses_.rend(), stays);
      CHECK((oldest != uses_.rend()) == true);
      evict(*oldest);
    }
    insert(tile, false);
  }
}

template <class Content>
uint64_t TileCache<Content>::bytesOf(int tile) {
  const auto known = bytes_.find(tile);
  if (known != bytes_.end()) return known->second;
  return bytes_[tile] = source_.bytes(tile);
}

template <class Content>
void TileCache<Content>::insert(int tile, bool pinned) {
  const uint64_t allowed = bytesOf(tile);
  Entry entry;
  entry.content = source_.load(tile);
  entry.bytes = bytesInMemory(entry.content);
  entry.pinned = pinned;
  if (entry.bytes > allowed) {
    throw Error(source_.file(tile), "", fmt::format("takes {} bytes of memory, its file said {}", entry.bytes, allowed),
                "leave a scene alone while it is drawn");
  }
  uses_.push_front(tile);
  entry.use = uses_.begin();
  statistics_.bytes += entry.bytes;
  statistics_.mostBytes = std::max(statistics_.mostBytes, statistics_.bytes);
  ++statistics_.loads;
  const bool inserted = contents_.emplace(tile, std::move(entry)).second;
  CHECK(inserted == true);
  CHECK(statistics_.bytes <= budget_);
}

template <class Content>
void TileCache<Content>::evict(int tile) {
  const auto found = contents_.find(tile);
  statistics_.bytes -= found->second.bytes;
  ++statistics_.evictions;
  uses_.erase(found->second.use);
  contents_.erase(found);
}

template class TileCache<VolumeContent>;
template class TileCache<HashContent>;

}  // namespace tessera
