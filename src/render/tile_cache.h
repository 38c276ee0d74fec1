// Contents in memory, never more than a number of bytes of them and of the resources that they share. What must always
// be there (the coarsest level, the surround) is loaded first and stays; of the rest, what has not been used for
// longest goes first.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <list>
#include <memory>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/check.h"
#include "base/error.h"
#include "render/tile_tree.h"

namespace tessera {

struct TileCacheStatistics {
  uint64_t bytes = 0, mostBytes = 0;  // held now, and at most so far
  uint64_t hits = 0, loads = 0, evictions = 0;
};

// Where contents come from. Held: Content, in the machine's memory, or GpuContent, on a GPU; both have a memoryBytes().
// `bytes`, `load` and `bytesOfResource` may throw Error.
template <class Held>
struct TileSource {
  // That it takes in memory at most, found out without loading it; without its resources.
  std::function<uint64_t(int tile)> bytes;
  std::function<std::unique_ptr<Held>(int tile)> load;
  // For errors: the folder, and the file of a content in it.
  std::string folder = "scene";
  std::function<std::string(int tile)> file = [](int tile) { return "content of tile " + std::to_string(tile); };
  // The numbers of the resources that a content shares with others, each once; it keeps them in memory. And what one of
  // them takes at most, however many contents need it.
  std::function<std::vector<int>(int tile)> resourcesOf = [](int) { return std::vector<int>(); };
  std::function<uint64_t(int resource)> bytesOfResource = [](int) { return uint64_t{0}; };
  // Keeps those of a tile's resources in memory that are there, as long as what it returns.
  std::function<std::shared_ptr<const void>(int tile)> holdResources = [](int) { return nullptr; };
};

template <class Held>
class TileCache {
 public:
  // Loads what must stay. Throws Error naming the folder where that alone is more than `budgetBytes`.
  TileCache(const TileTree& tree, uint64_t budgetBytes, TileSource<Held> source);

  bool holds(int tile) const { return contents_.contains(tile); }
  // Null where it is not in memory. Counts as a use; the content stays where it is until it is evicted.
  const Held* find(int tile);

  // Loads those that are missing, in their order; evicts others where there is need of their room. All of `tiles` must
  // fit into the budget beside what must stay, resources counted once. Throws Error naming its file where a content is
  // larger than its source said.
  void load(std::span<const int> tiles);

  // That a tile takes in memory without its resources, known without loading it. Throws what the source throws.
  uint64_t bytesOf(int tile);
  const std::vector<int>& resourcesOf(int tile);
  uint64_t bytesOfResource(int resource);
  uint64_t budgetBytes() const { return budget_; }
  const TileCacheStatistics& statistics() const { return statistics_; }

 private:
  struct Entry {
    std::unique_ptr<Held> content;
    uint64_t bytes = 0;
    bool pinned = false;
    std::list<int>::iterator use;
  };
  // What loading a tile adds: resources that a content in memory needs too are there already.
  uint64_t bytesToLoad(int tile);
  void insert(int tile, bool pinned);
  void evict(int tile);

  uint64_t budget_;
  TileSource<Held> source_;
  std::unordered_map<int, uint64_t> bytes_, resourceBytes_;  // as far as known
  std::unordered_map<int, std::vector<int>> resources_;      // likewise
  std::unordered_map<int, Entry> contents_;
  std::unordered_map<int, int> usersOfResource_;  // contents in memory that need it; none is left out
  std::list<int> uses_;                           // the latest first
  TileCacheStatistics statistics_;
};

template <class Held>
TileCache<Held>::TileCache(const TileTree& tree, uint64_t budgetBytes, TileSource<Held> source)
    : budget_(budgetBytes), source_(std::move(source)) {
  tree.check();
  std::vector<int> pinned = tree.coarsest();
  if (tree.surround >= 0) pinned.push_back(tree.surround);
  uint64_t bytes = 0;
  std::vector<int> resources;
  for (const int tile : pinned) {
    bytes += bytesOf(tile);
    resources.insert(resources.end(), resourcesOf(tile).begin(), resourcesOf(tile).end());
  }
  std::sort(resources.begin(), resources.end());
  resources.erase(std::unique(resources.begin(), resources.end()), resources.end());
  for (const int resource : resources) bytes += bytesOfResource(resource);
  if (bytes > budget_) {
    throw Error(source_.folder, "",
                fmt::format("its coarsest level takes {} bytes of memory, the budget is {}", bytes, budget_),
                fmt::format("allow at least {:.4g} MiB", static_cast<double>(bytes) / 1048576 * 1.0001));
  }
  for (const int tile : pinned) insert(tile, true);
}

template <class Held>
const Held* TileCache<Held>::find(int tile) {
  const auto found = contents_.find(tile);
  if (found == contents_.end()) return nullptr;
  ++statistics_.hits;
  uses_.splice(uses_.begin(), uses_, found->second.use);
  return found->second.content.get();
}

template <class Held>
void TileCache<Held>::load(std::span<const int> tiles) {
  const auto stays = [&](int tile) {
    return contents_.at(tile).pinned || std::find(tiles.begin(), tiles.end(), tile) != tiles.end();
  };
  for (const int tile : tiles) {
    if (holds(tile)) continue;
    const std::shared_ptr<const void> shared = source_.holdResources(tile);  // also while their last user is evicted
    while (statistics_.bytes + bytesToLoad(tile) > budget_) {
      const auto oldest = std::find_if_not(uses_.rbegin(), uses_.rend(), stays);
      CHECK((oldest != uses_.rend()) == true);
      evict(*oldest);
    }
    insert(tile, false);
  }
}

template <class Held>
uint64_t TileCache<Held>::bytesOf(int tile) {
  const auto known = bytes_.find(tile);
  if (known != bytes_.end()) return known->second;
  return bytes_[tile] = source_.bytes(tile);
}

template <class Held>
const std::vector<int>& TileCache<Held>::resourcesOf(int tile) {
  const auto known = resources_.find(tile);
  if (known != resources_.end()) return known->second;
  return resources_[tile] = source_.resourcesOf(tile);
}

template <class Held>
uint64_t TileCache<Held>::bytesOfResource(int resource) {
  const auto known = resourceBytes_.find(resource);
  if (known != resourceBytes_.end()) return known->second;
  return resourceBytes_[resource] = source_.bytesOfResource(resource);
}

template <class Held>
uint64_t TileCache<Held>::bytesToLoad(int tile) {
  uint64_t bytes = bytesOf(tile);
  for (const int resource : resourcesOf(tile)) {
    if (!usersOfResource_.contains(resource)) bytes += bytesOfResource(resource);
  }
  return bytes;
}

template <class Held>
void TileCache<Held>::insert(int tile, bool pinned) {
  const uint64_t allowed = bytesOf(tile);
  Entry entry;
  entry.content = source_.load(tile);
  entry.bytes = entry.content->memoryBytes();
  entry.pinned = pinned;
  if (entry.bytes > allowed) {
    throw Error(source_.file(tile), "", fmt::format("takes {} bytes of memory, its file said {}", entry.bytes, allowed),
                "leave a scene alone while it is drawn");
  }
  uses_.push_front(tile);
  entry.use = uses_.begin();
  statistics_.bytes += entry.bytes;
  for (const int resource : resourcesOf(tile)) {
    if (usersOfResource_[resource]++ == 0) statistics_.bytes += bytesOfResource(resource);
  }
  statistics_.mostBytes = std::max(statistics_.mostBytes, statistics_.bytes);
  ++statistics_.loads;
  const bool inserted = contents_.emplace(tile, std::move(entry)).second;
  CHECK(inserted == true);
  CHECK(statistics_.bytes <= budget_);
}

template <class Held>
void TileCache<Held>::evict(int tile) {
  const auto found = contents_.find(tile);
  statistics_.bytes -= found->second.bytes;
  for (const int resource : resourcesOf(tile)) {
    if (--usersOfResource_.at(resource) > 0) continue;
    usersOfResource_.erase(resource);
    statistics_.bytes -= bytesOfResource(resource);
  }
  ++statistics_.evictions;
  uses_.erase(found->second.use);
  contents_.erase(found);
}

}  // namespace tessera
