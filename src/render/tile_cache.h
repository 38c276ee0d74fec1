// Contents in memory, never more than a number of bytes of them. What must always be there (the coarsest level, the
// surround) is loaded first and stays; of the rest, what has not been used for longest goes first.
#pragma once

#include <functional>
#include <list>
#include <span>
#include <string>
#include <unordered_map>

#include "render/tile_tree.h"

namespace tessera {

struct TileCacheStatistics {
  uint64_t bytes = 0, mostBytes = 0;  // held now, and at most so far
  uint64_t hits = 0, loads = 0, evictions = 0;
};

// Where contents come from: VolumeContent or HashContent. `bytes` and `load` may throw Error.
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

}  // namespace tessera
