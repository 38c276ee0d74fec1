// What of a scene a view is drawn from: the cut that it asks for, loaded as far as a budget goes before it is drawn.
// All renderers of scenes in this program choose alike.
#pragma once

#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "render/tile_cache.h"
#include "render/tile_frame.h"
#include "render/tile_selection.h"

namespace tessera {

// Of a content, the part in a box, whose sides may be infinite.
template <class Content>
struct DrawnContent {
  const Content* content;
  Vec3d low, high;  // scene units

  DrawnContent(const Content* content)  // NOLINT(google-explicit-constructor): all of it
      : DrawnContent(content, Vec3d::Constant(-INFINITY), Vec3d::Constant(INFINITY)) {}
  DrawnContent(const Content* content, const Vec3d& low, const Vec3d& high) : content(content), low(low), high(high) {}
};

// Content: as of TileCache.
template <class Content>
class SceneTiles {
 public:
  // Throws Error where the coarsest level does not fit into the budget.
  SceneTiles(const TileFrame& frame, TileTree tree, TileSource<Content> source, const SelectionSettings& selection,
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

  // Of the last view, in an order that is front to back for every ray of its camera. Counts as a use of each.
  std::vector<DrawnContent<Content>> frontToBack() {
    std::vector<DrawnContent<Content>> contents;
    for (const SelectedTile& selected : cut_.tiles) {
      if (!selected.visible) continue;
      DrawnContent<Content>& drawn = contents.emplace_back(cache_.find(selected.content));
      if (selected.content == selected.tile) continue;
      const TileBox cells = tree_.boxOfCells(selected.tile);
      drawn.low = cells.low;
      drawn.high = cells.high;
    }
    return contents;
  }
  const Content* surround() { return cut_.surround >= 0 ? cache_.find(cut_.surround) : nullptr; }  // may be null
  // One that is always there, whatever is in view; null where the scene is empty.
  const Content* always() {
    const std::vector<int> coarsest = tree_.coarsest();
    return coarsest.empty() ? nullptr : cache_.find(coarsest.front());
  }

  const TileFrame& frame() const { return frame_; }
  const TileCut& cut() const { return cut_; }
  const TileChoice& choice() const { return choice_; }
  const TileCache<Content>& cache() const { return cache_; }

 private:
  void choose(const TileView& view) {
    const auto holds = [this](int tile) { return cache_.holds(tile); };
    choice_ = selector_.choose(view, {cache_.budgetBytes(), holds, [this](int tile) { return cache_.bytesOf(tile); }});
    missing_.clear();
  }
  void cut(const TileView& view) {
    cut_ = selector_.cut(view, [this](int tile) { return cache_.holds(tile); });
  }

  TileFrame frame_;
  TileTree tree_;
  TileCache<Content> cache_;
  TileSelector selector_;
  TileChoice choice_;
  TileCut cut_;
  std::vector<int> missing_;
};

}  // namespace tessera
