// Contents in memory, never more than a number of bytes of them. What must always be there (the coarsest level, the
// surround) is loaded first and stays; of the rest, what has not been used for longest goes first.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <list>
#include <span>
#include <string>
#include <unordered_map>

#include "base/check.h"
#include "base/error.h"
#include "render/tile_tree.h"

namespace tessera {

struct TileCacheStatistics {
  uint64_t bytes = 0, mostBytes = 0;  // held now, and at most so far
  uint64_t hits = 0, loads = 0, evictions = 0;
};

// Where contents come from: VolumeContent, HashContent, or one of these on a graphics card; all have a bytesInMemory().
// `bytes` and `load` may throw Error.
template <class Content>
struct TileSource {
  std::function<uint64_t(int tile)> bytes;  // that it takes in memory (bytesInMemory), found out without loading it
  std::function<Content(int tile)> load;
  // For errors: the folder, and the file of a content in it.
  std::string folder = "scene";
  std::function<std::string(int tile)> file = [](int tile) { return "content of tile " + std::to_string(tile); };
};

template <class Content>
class TileCache {
 public:
  // Loads what must stay. Throws Error naming the folder where that alone is more than `budgetBytes`.
  TileCache(const TileTree& tree, uint64_t budgetBytes, TileSource<Content> source);

  bool holds(int tile) const { return contents_.contains(tile); }
  // Null where it is not in memory. Counts as a use; the content stays where it is until it is evicted.
  const Content* find(int tile);

  // Loads those that are missing, in their order; evicts others where there is need of their room. All of `tiles` must
  // fit into the budget beside what must stay. Throws Error naming its file where a content is larger than its source
  // said.
  void load(std::span<const int> tiles);

  // That a tile takes in memory, known without loading it. Throws what the source throws.
  uint64_t bytesOf(int tile);
  uint64_t budgetBytes() const { return budget_; }
  const TileCacheStatistics& statistics() const { return statistics_; }

 private:
  struct Entry {
    Content content;
    uint64_t bytes = 0;
    bool pinned = false;
    std::list<int>::iterator use;
  };
  void insert(int tile, bool pinned);
  void evict(int tile);

  uint64_t budget_;
  TileSource<Content> source_;
  std::unordered_map<int, uint64_t> bytes_;  // as far as known
  std::unordered_map<int, Entry> contents_;
  std::list<int> uses_;  // the latest first
  TileCacheStatistics statistics_;
};

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

}  // namespace tessera
