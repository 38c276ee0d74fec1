// Cross-fades between levels of detail: where successive cuts of the tree draw different contents, both are drawn for
// some frames, each in a share of the pixels that moves from the old content to the new one.
#pragma once

#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "render/tile_selection.h"
#include "render/tile_tree.h"

namespace tessera {

// A content in the cells of a tile, in those pixels whose threshold lies in [low, high).
struct FadedTile {
  int tile = 0, content = 0;
  float low = 0, high = 1;

  bool operator==(const FadedTile&) const = default;
};

class LevelFades {
 public:
  // Keeps a reference to `tree`. `frames`: number of frames in which both contents are drawn.
  explicit LevelFades(const TileTree& tree, int frames = 12) : tree_(tree), frames_(frames) {}

  // Returns what to draw for the next frame, whose cut is given. `holds` says which contents are in memory: a fade from
  // a content that has been evicted ends at once.
  std::vector<FadedTile> next(const TileCut& cut, const std::function<bool(int)>& holds);
  bool isFading() const { return !fades_.empty(); }
  // The next cut is drawn as it is.
  void reset();

 private:
  struct Fade {
    int from = 0, to = 0;  // contents
    int passed = 0;        // frames
  };
  // What the last cut drew in a tile or in a part of it.
  struct Before {
    int region = 0;  // a tile
    int content = 0;
  };
  std::vector<Before> contentsBefore(int tile) const;
  std::vector<std::pair<int, Fade>> fadesWithin(int region) const;
  bool isWithin(int tile, int region) const;
  void change(const Before& before, int content, const std::function<bool(int)>& holds, std::map<int, Fade>& fades);

  const TileTree& tree_;
  int frames_;
  std::map<int, int> shown_;   // the visible tiles of the last cut, and their contents
  std::map<int, Fade> fades_;  // by tile, none of which lies within another one
};

}  // namespace tessera
