#include "render/tile_cache.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/check.h"
#include "base/error.h"

namespace tessera {

TileCache::TileCache(const TileTree& tree, uint64_t budgetBytes, TileSource source)
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

const VolumeContent* TileCache::find(int tile) {
  const auto found = contents_.find(tile);
  if (found == contents_.end()) return nullptr;
  ++statistics_.hits;
  uses_.splice(uses_.begin(), uses_, found->second.use);
  return &found->second.content;
}

bool TileCache::load(std::span<const int> tiles, std::span<const int> kept) {
  uint64_t wanted = 0;
  for (const int tile : tiles) {
    if (!holds(tile)) wanted += bytesOf(tile);
  }
  const auto stays = [&](int tile) {
    return contents_.at(tile).pinned || std::find(kept.begin(), kept.end(), tile) != kept.end() ||
           std::find(tiles.begin(), tiles.end(), tile) != tiles.end();
  };
  uint64_t held = statistics_.bytes;
  std::vector<int> going;
  for (auto use = uses_.rbegin(); use != uses_.rend() && held + wanted > budget_; ++use) {
    if (stays(*use)) continue;
    going.push_back(*use);
    held -= contents_.at(*use).bytes;
  }
  if (held + wanted > budget_) {
    ++statistics_.refusals;
    return false;
  }
  for (const int tile : going) evict(tile);
  for (const int tile : tiles) {
    if (!holds(tile)) insert(tile, false);
  }
  return true;
}

uint64_t TileCache::bytesOf(int tile) {
  const auto known = bytes_.find(tile);
  if (known != bytes_.end()) return known->second;
  return bytes_[tile] = source_.bytes(tile);
}

void TileCache::insert(int tile, bool pinned) {
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

void TileCache::evict(int tile) {
  const auto found = contents_.find(tile);
  statistics_.bytes -= found->second.bytes;
  ++statistics_.evictions;
  uses_.erase(found->second.use);
  contents_.erase(found);
}

}  // namespace tessera
