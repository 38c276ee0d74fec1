#include "render/level_fades.h"

#include <set>

namespace tessera {

void LevelFades::reset() {
  shown_.clear();
  fades_.clear();
}

bool LevelFades::isWithin(int tile, int region) const {
  while (tile >= 0 && tile != region) tile = tree_.tiles[tile].parent;
  return tile == region;
}

std::vector<LevelFades::Before> LevelFades::contentsBefore(int tile) const {
  for (int above = tile; above >= 0; above = tree_.tiles[above].parent)
    if (const auto shown = shown_.find(above); shown != shown_.end()) return {{tile, shown->second}};
  std::vector<Before> below;
  for (const auto& [region, content] : shown_)
    if (isWithin(region, tile)) below.push_back({region, content});
  return below;
}

// Returns the fades in a tile: those of tiles within it, or else that of a tile around it.
std::vector<std::pair<int, LevelFades::Fade>> LevelFades::fadesWithin(int region) const {
  std::vector<std::pair<int, Fade>> within;
  for (const auto& [tile, fade] : fades_)
    if (isWithin(tile, region)) within.emplace_back(tile, fade);
  for (int above = region; within.empty() && above >= 0; above = tree_.tiles[above].parent)
    if (const auto around = fades_.find(above); around != fades_.end()) within.emplace_back(region, around->second);
  return within;
}

void LevelFades::change(const Before& before, int content, const std::function<bool(int)>& holds,
                        std::map<int, Fade>& fades) {
  const bool isChanged = before.content != content;
  const auto add = [&](int region, const Fade& fade) {
    if (fade.passed < frames_ && holds(fade.from)) fades[region] = fade;
  };
  const auto running = fadesWithin(before.region);
  if (running.empty() && isChanged) add(before.region, {before.content, content, 0});
  for (const auto& [region, fade] : running) {
    if (!isChanged && fade.to == content) {
      add(region, {fade.from, fade.to, fade.passed + 1});
    } else if (isChanged && fade.from == content && fade.to == before.content) {
      add(region, {fade.to, fade.from, frames_ - 1 - fade.passed});  // back again, from where it was
    } else if (isChanged) {
      add(region, {before.content, content, 0});
    }
  }
}

std::vector<FadedTile> LevelFades::next(const TileCut& cut, const std::function<bool(int)>& holds) {
  std::map<int, Fade> fades;
  std::map<int, int> shown;
  for (const SelectedTile& selected : cut.tiles) {
    if (!selected.visible) continue;
    shown[selected.tile] = selected.content;
    for (const Before& before : contentsBefore(selected.tile)) change(before, selected.content, holds, fades);
  }
  shown_ = std::move(shown);
  fades_ = std::move(fades);
  std::set<int> split;  // tiles in parts of which contents fade
  for (const auto& [region, fade] : fades_)
    for (int above = tree_.tiles[region].parent; above >= 0; above = tree_.tiles[above].parent) split.insert(above);
  std::vector<FadedTile> drawn;
  const std::function<void(int, int)> add = [&](int tile, int content) {
    if (const auto fade = fades_.find(tile); fade != fades_.end()) {
      const float share = static_cast<float>(fade->second.passed + 1) / static_cast<float>(frames_ + 1);
      drawn.push_back({tile, fade->second.to, 0, share});
      drawn.push_back({tile, fade->second.from, share, 1});
    } else if (split.contains(tile)) {
      for (const int child : tree_.tiles[tile].children) add(child, content);
    } else {
      drawn.push_back({tile, content});
    }
  };
  for (const SelectedTile& selected : cut.tiles)
    if (selected.visible) add(selected.tile, selected.content);
  return drawn;
}

}  // namespace tessera
