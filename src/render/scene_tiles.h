// Selects and loads the tiles from which a view is drawn: the cut that the view requests, of which as much is loaded
// before drawing as fits into the budget. All scene renderers of this program use this class.
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "render/drawer.h"
#include "render/level_fades.h"
#include "render/tile_cache.h"
#include "render/tile_frame.h"
#include "render/tile_selection.h"

namespace tessera {

// Returns the settings with what they leave to a drawer (CpuDrawer, GpuDrawer).
template <class Drawer>
SelectionSettings selectionFor(const Drawer& drawer, SelectionSettings settings) {
  if (settings.hysteresis == 0) settings.hysteresis = drawer.hysteresis();
  return settings;
}

// ResidentContent: see TileCache.
template <class ResidentContent>
class SceneTiles {
 public:
  // Throws Error if the coarsest level does not fit into the budget.
  SceneTiles(const TileFrame& frame, TileTree tree, TileSource<ResidentContent> source,
             const SelectionSettings& selection, uint64_t budgetBytes)
      : frame_(frame),
        tree_(std::move(tree)),
        cache_(tree_, budgetBytes, std::move(source)),
        selector_(tree_, selection),
        fades_(tree_) {}
  SceneTiles(const SceneTiles&) = delete;

  // Loads what the view requests. Rethrows what the source throws.
  void loadFor(const TileView& view) {
    choose(view);
    cache_.load(choice_.requested);
    cut(view);
  }
  // Loads at most one tile: `ready` receives the missing tiles, the most urgent first, and returns the tile to load
  // now, or -1 for none. The cut is made of the tiles that are in memory.
  void loadReadyFor(const TileView& view, const std::function<int(const std::vector<int>& missing)>& ready) {
    choose(view);
    std::vector<int> present;
    for (const int tile : choice_.requested) (cache_.holds(tile) ? present : missing_).push_back(tile);
    if (const int tile = ready(missing_); tile >= 0) {
      present.push_back(tile);
      cache_.load(present);
      std::erase(missing_, tile);
    }
    cut(view);
  }
  const std::vector<int>& missing() const {
    return missing_;
  }  // tiles that the last view requested and that are not in memory

  // Returns what to draw for the last view. Counts as a use of each content. `crossFades`: whether contents fade into
  // those that the view before showed in their places.
  SceneView<ResidentContent> view(bool crossFades = false) {
    SceneView<ResidentContent> view{frame_, {}, nullptr, nullptr};
    std::vector<FadedTile> tiles;
    if (crossFades) {
      tiles = fades_.next(cut_, [this](int tile) { return cache_.holds(tile); });
    } else {
      fades_.reset();
      for (const SelectedTile& selected : cut_.tiles)
        if (selected.visible) tiles.push_back({selected.tile, selected.content});
    }
    for (const FadedTile& tile : tiles) {
      DrawnContent<ResidentContent>& drawn = view.frontToBack.emplace_back(cache_.find(tile.content));
      drawn.share = {tile.low, tile.high};
      if (tile.content == tile.tile) continue;
      const TileBox cells = tree_.boxOfCells(tile.tile);
      drawn.low = cells.low;
      drawn.high = cells.high;
    }
    if (cut_.backgroundBlock >= 0) view.backgroundBlock = cache_.find(cut_.backgroundBlock);
    const std::vector<int> coarsest = tree_.coarsest();
    if (!coarsest.empty()) view.pinned = cache_.find(coarsest.front());
    return view;
  }

  // Returns whether the last view shows contents that fade, and the next view of the same camera therefore differs.
  bool isFading() const { return fades_.isFading(); }

  const TileFrame& frame() const { return frame_; }
  const TileCut& cut() const { return cut_; }
  const TileChoice& choice() const { return choice_; }
  const TileCache<ResidentContent>& cache() const { return cache_; }

 private:
  void choose(const TileView& view) {
    const auto holds = [this](int tile) { return cache_.holds(tile); };
    choice_ =
        selector_.choose(view, {cache_.budgetBytes(), holds, [this](int tile) { return cache_.countTileBytes(tile); },
                                [this](int tile) { return cache_.tileResources(tile); },
                                [this](int resource) { return cache_.bytesOfResource(resource); }});
    missing_.clear();
  }
  void cut(const TileView& view) {
    cut_ = selector_.cut(view, [this](int tile) { return cache_.holds(tile); });
  }

  TileFrame frame_;
  TileTree tree_;
  TileCache<ResidentContent> cache_;
  TileSelector selector_;
  LevelFades fades_;
  TileChoice choice_;
  TileCut cut_;
  std::vector<int> missing_;
};

}  // namespace tessera
