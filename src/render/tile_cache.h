// A cache of tile contents that never exceeds a budget in bytes, including the resources that contents share. What must
// always be resident (the coarsest level and the background block) is loaded first and pinned; the rest is evicted in
// least-recently-used order.
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
  uint64_t bytes = 0, maxBytes = 0;  // resident now, and the maximum so far
  uint64_t hits = 0, loads = 0, evictions = 0;
};

// Provides the contents of tiles. ResidentContent is Content, in CPU memory, or GpuContent, in GPU memory; both have
// memoryBytes(). `bytes`, `load` and `bytesOfResource` may throw Error.
template <class ResidentContent>
struct TileSource {
  // An upper bound of the content's memory without its resources, known without loading it.
  std::function<uint64_t(int tile)> bytes;
  std::function<std::unique_ptr<ResidentContent>(int tile)> load;
  // For error messages: the scene's folder, and the file of a content in it.
  std::string folder = "scene";
  std::function<std::string(int tile)> file = [](int tile) { return "content of tile " + std::to_string(tile); };
  // `tileResources` returns the indices of the resources that a content shares with others, each once; a resident
  // content keeps its resources in memory. `bytesOfResource` returns an upper bound of the memory of one of them,
  // however many contents use it.
  std::function<std::vector<int>(int tile)> tileResources = [](int) { return std::vector<int>(); };
  std::function<uint64_t(int resource)> bytesOfResource = [](int) { return uint64_t{0}; };
  // Keeps those resources of a tile that are already in memory alive as long as the returned pointer lives.
  std::function<std::shared_ptr<const void>(int tile)> holdResources = [](int) { return nullptr; };
};

template <class ResidentContent>
class TileCache {
 public:
  // Loads the pinned tiles. Throws Error naming the folder if they alone exceed `budgetBytes`.
  TileCache(const TileTree& tree, uint64_t budgetBytes, TileSource<ResidentContent> source);

  bool holds(int tile) const { return contents_.contains(tile); }
  // Returns null if the tile is not in memory. Counts as a use; the pointer is valid until the tile is evicted.
  const ResidentContent* find(int tile);

  // Loads those of `tiles` that are missing, in the given order, and evicts other tiles as needed. All of `tiles`
  // together with the pinned tiles must fit into the budget, with shared resources counted once. Throws Error naming
  // the file if a content is larger than its source declared.
  void load(std::span<const int> tiles);

  // Returns the memory that a tile takes without its resources, known without loading it. Rethrows what the source
  // throws.
  uint64_t countTileBytes(int tile);
  const std::vector<int>& tileResources(int tile);
  uint64_t bytesOfResource(int resource);
  uint64_t budgetBytes() const { return budget_; }
  const TileCacheStatistics& statistics() const { return statistics_; }

 private:
  struct Entry {
    std::unique_ptr<ResidentContent> content;
    uint64_t bytes = 0;
    bool pinned = false;
    std::list<int>::iterator use;
  };
  // Bytes that loading a tile adds: resources that another resident content uses are already in memory.
  uint64_t bytesToLoad(int tile);
  void insert(int tile, bool pinned);
  void evict(int tile);

  uint64_t budget_;
  TileSource<ResidentContent> source_;
  std::unordered_map<int, uint64_t> bytes_, resourceBytes_;  // cached answers of the source
  std::unordered_map<int, std::vector<int>> resources_;      // cached answers of the source
  std::unordered_map<int, Entry> contents_;
  std::unordered_map<int, int> usersOfResource_;  // number of resident contents that use a resource; never 0
  std::list<int> uses_;                           // the most recent first
  TileCacheStatistics statistics_;
};

template <class ResidentContent>
TileCache<ResidentContent>::TileCache(const TileTree& tree, uint64_t budgetBytes, TileSource<ResidentContent> source)
    : budget_(budgetBytes), source_(std::move(source)) {
  tree.check();
  std::vector<int> pinned = tree.coarsest();
  if (tree.backgroundBlock >= 0) pinned.push_back(tree.backgroundBlock);
  uint64_t bytes = 0;
  std::vector<int> resources;
  for (const int tile : pinned) {
    bytes += countTileBytes(tile);
    resources.insert(resources.end(), tileResources(tile).begin(), tileResources(tile).end());
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

template <class ResidentContent>
const ResidentContent* TileCache<ResidentContent>::find(int tile) {
  const auto it = contents_.find(tile);
  if (it == contents_.end()) return nullptr;
  ++statistics_.hits;
  uses_.splice(uses_.begin(), uses_, it->second.use);
  return it->second.content.get();
}

template <class ResidentContent>
void TileCache<ResidentContent>::load(std::span<const int> tiles) {
  const auto isNeeded = [&](int tile) {
    return contents_.at(tile).pinned || std::find(tiles.begin(), tiles.end(), tile) != tiles.end();
  };
  for (const int tile : tiles) {
    if (holds(tile)) continue;
    const std::shared_ptr<const void> shared =
        source_.holdResources(tile);  // keeps shared resources while their last user is evicted
    while (statistics_.bytes + bytesToLoad(tile) > budget_) {
      const auto oldest = std::find_if_not(uses_.rbegin(), uses_.rend(), isNeeded);
      CHECK((oldest != uses_.rend()) == true);
      evict(*oldest);
    }
    insert(tile, false);
  }
}

template <class ResidentContent>
uint64_t TileCache<ResidentContent>::countTileBytes(int tile) {
  const auto known = bytes_.find(tile);
  if (known != bytes_.end()) return known->second;
  return bytes_[tile] = source_.bytes(tile);
}

template <class ResidentContent>
const std::vector<int>& TileCache<ResidentContent>::tileResources(int tile) {
  const auto known = resources_.find(tile);
  if (known != resources_.end()) return known->second;
  return resources_[tile] = source_.tileResources(tile);
}

template <class ResidentContent>
uint64_t TileCache<ResidentContent>::bytesOfResource(int resource) {
  const auto known = resourceBytes_.find(resource);
  if (known != resourceBytes_.end()) return known->second;
  return resourceBytes_[resource] = source_.bytesOfResource(resource);
}

template <class ResidentContent>
uint64_t TileCache<ResidentContent>::bytesToLoad(int tile) {
  uint64_t bytes = countTileBytes(tile);
  for (const int resource : tileResources(tile)) {
    if (!usersOfResource_.contains(resource)) bytes += bytesOfResource(resource);
  }
  return bytes;
}

template <class ResidentContent>
void TileCache<ResidentContent>::insert(int tile, bool pinned) {
  const uint64_t allowed = countTileBytes(tile);
  Entry entry;
  entry.content = source_.load(tile);
  entry.bytes = entry.content->memoryBytes();
  entry.pinned = pinned;
  if (entry.bytes > allowed) {
    throw Error(source_.file(tile), "", fmt::format("takes {} bytes of memory, its file said {}", entry.bytes, allowed),
                "do not change a scene while it is being rendered");
  }
  uses_.push_front(tile);
  entry.use = uses_.begin();
  statistics_.bytes += entry.bytes;
  for (const int resource : tileResources(tile)) {
    if (usersOfResource_[resource]++ == 0) statistics_.bytes += bytesOfResource(resource);
  }
  statistics_.maxBytes = std::max(statistics_.maxBytes, statistics_.bytes);
  ++statistics_.loads;
  const bool inserted = contents_.emplace(tile, std::move(entry)).second;
  CHECK(inserted == true);
  CHECK(statistics_.bytes <= budget_);
}

template <class ResidentContent>
void TileCache<ResidentContent>::evict(int tile) {
  const auto it = contents_.find(tile);
  statistics_.bytes -= it->second.bytes;
  for (const int resource : tileResources(tile)) {
    if (--usersOfResource_.at(resource) > 0) continue;
    usersOfResource_.erase(resource);
    statistics_.bytes -= bytesOfResource(resource);
  }
  ++statistics_.evictions;
  uses_.erase(it->second.use);
  contents_.erase(it);
}

}  // namespace tessera
