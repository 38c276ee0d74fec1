// What of a scene a view is drawn from: the cut that it asks for, loaded as far as a budget goes before it is drawn.
// All renderers of scenes in this program choose alike.
#pragma once

#include <functional>
#include <utility>
#include <vector>

#include "render/drawer.h"
#include "render/tile_cache.h"
#include "render/tile_frame.h"
#include "render/tile_selection.h"

namespace tessera {

// Held: as of TileCache.
template <class Held>
class SceneTiles {
 public:
  // Throws Error where the coarsest level does not fit into the budget.
  SceneTiles(const TileFrame& frame, TileTree tree, TileSource<Held> source, const SelectionSettings& selection,
             uint64_t budgetBytes)
      : frame_(frame),
        tree_(std::move(tree)),
        cache_(tree_, budgetBytes, std::move(source)),
        selector_(tree_, selection) {}
  SceneTiles(const SceneTiles&) = delete;

  // Throws what the source throws.
  void loadFor(const TileView& view) {
    choose(view);
    cache_.load(choice_.wanted);
    cut(view);
  }
  // Loads only one that is ready, if any: `ready` is given what is missing, the most urgent first, and answers which
  // comes now; -1: none. The cut is of what is there.
  void loadReadyFor(const TileView& view, const std::function<int(const std::vector<int>& missing)>& ready) {
    choose(view);
    std::vector<int> present;
    for (const int tile : choice_.wanted) (cache_.holds(tile) ? present : missing_).push_back(tile);
    if (const int tile = ready(missing_); tile >= 0) {
      present.push_back(tile);
      cache_.load(present);
      std::erase(missing_, tile);
    }
    cut(view);
  }
  const std::vector<int>& missing() const { return missing_; }  // of the last view's wanted ones

  // Of the last view. Counts as a use of each content.
  SceneView<Held> view() {
    SceneView<Held> view{frame_, {}, nullptr, nullptr};
    for (const SelectedTile& selected : cut_.tiles) {
      if (!selected.visible) continue;
      DrawnContent<Held>& drawn = view.frontToBack.emplace_back(cache_.find(selected.content));
      if (selected.content == selected.tile) continue;
      const TileBox cells = tree_.boxOfCells(selected.tile);
      drawn.low = cells.low;
      drawn.high = cells.high;
    }
    if (cut_.surround >= 0) view.surround = cache_.find(cut_.surround);
    const std::vector<int> coarsest = tree_.coarsest();
    if (!coarsest.empty()) view.pinned = cache_.find(coarsest.front());
    return view;
  }

  const TileFrame& frame() const { return frame_; }
  const TileCut& cut() const { return cut_; }
  const TileChoice& choice() const { return choice_; }
  const TileCache<Held>& cache() const { return cache_; }

 private:
  void choose(const TileView& view) {
    const auto holds = [this](int tile) { return cache_.holds(tile); };
    choice_ = selector_.choose(view, {cache_.budgetBytes(), holds, [this](int tile) { return cache_.bytesOf(tile); },
                                      [this](int tile) { return cache_.resourcesOf(tile); },
                                      [this](int resource) { return cache_.bytesOfResource(resource); }});
    missing_.clear();
  }
  void cut(const TileView& view) {
    cut_ = selector_.cut(view, [this](int tile) { return cache_.holds(tile); });
  }

  TileFrame frame_;
  TileTree tree_;
  TileCache<Held> cache_;
  TileSelector selector_;
  TileChoice choice_;
  TileCut cut_;
  std::vector<int> missing_;
};

}  // namespace tessera
