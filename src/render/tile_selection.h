// Which tiles to draw, and which to have in memory for it (City-on-Web, section 4.5; algorithms' section 9).
//
// The picture is a cut through the tree: tiles that together cover what the root covers, each place once. A tile is
// replaced by its children while its error, projected, is above a number of pixels; once it is, it stays so until the
// error is smaller by `hysteresis`. Where a tile of the cut is not in memory, what is above it is drawn, in that tile's
// cells.
//
// What is wanted in memory is chosen anew for each view: the most urgent first, as far as the budget goes. What is
// above a wanted tile is wanted too, so that whatever comes into view is drawn by that at once.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "render/tile_frame.h"
#include "render/tile_tree.h"
#include "scene/camera.h"

namespace tessera {

struct SelectionSettings {
  double mostPixels = 1.5;  // of geometric error; 0: the finest everywhere
  double hysteresis = 1.2;  // also what is in memory is so much more urgent
  int finestLevel = 0;      // tiles of this level and finer are never replaced
};

// What a camera sees of a scene, in its units.
struct TileView {
  Vec3d eye = Vec3d::Zero();
  Mat3d cameraFromScene = Mat3d::Identity();  // a rotation
  double focal = 1;                           // pixels
  double pixels = 1;                          // of the whole picture
  double surroundPixels = 1;                  // those in which the surround is looked at
  double nearest = 0.05;                      // distances below count as this
  // The picture in x/z and y/z; nothing where the lens may see anywhere.
  struct Window {
    double low[2], high[2];
  };
  std::optional<Window> window;

  bool sees(const TileNode& tile) const;  // true for all that can be seen, and for little else
  // Of the surround, to what is nearest of it beyond the sides of the scene's box: what lies above is sky, and the
  // ground hides what lies below.
  double distance(const TileNode& tile) const;
  double errorInPixels(const TileNode& tile) const;
  double areaInPixels(const TileNode& tile) const;  // that it may cover
};

TileView tileView(const Camera& camera, const Pose& worldFromCamera, const TileFrame& frame);

// Whether a ray shows what matters of the surround: it misses the scene's box, or leaves it through a side. What lies
// above is sky, and the ground hides what lies below.
bool showsSurround(const SceneRay& ray, const Vec3d& low, const Vec3d& high);

// What there is to choose from.
struct TileMemory {
  uint64_t budget = 0;                      // bytes
  std::function<bool(int tile)> holds;      // the coarsest, also of the surround, always
  std::function<uint64_t(int tile)> bytes;  // without its resources
  // Resources that a tile shares with others, each once: charged at the first tile that needs them.
  std::function<std::vector<int>(int tile)> resourcesOf = [](int) { return std::vector<int>(); };
  std::function<uint64_t(int resource)> bytesOfResource = [](int) { return uint64_t{0}; };
};

struct SelectedTile {
  int tile = 0;      // in whose cells is drawn
  int content = -1;  // the tile's, or of one above it
  bool visible = true;
};

struct TileCut {
  std::vector<SelectedTile> tiles;  // front to back for every ray of the view
  int surround = -1;                // the one to draw behind them
};

struct TileChoice {
  std::vector<int> wanted;  // to be in memory, beside the coarsest; the most urgent first
  int refused = 0;          // tiles for which the budget has no room
};

class TileSelector {
 public:
  // Keeps a reference to `tree`.
  TileSelector(const TileTree& tree, SelectionSettings settings);

  // What to have in memory for a view.
  TileChoice choose(const TileView& view, const TileMemory& memory);
  // `holds` says which contents are in memory; the coarsest, also of the surround, always are.
  TileCut cut(const TileView& view, const std::function<bool(int)>& holds);

 private:
  struct Pass;
  void cover(Pass& pass, int tile, int above);
  bool isReplaced(const TileView& view, int tile);
  void lookBelow(const TileView& view, int tile);

  const TileTree& tree_;
  SelectionSettings settings_;
  std::vector<int> pinned_;     // the coarsest, of the surround too
  std::vector<char> replaced_;  // tiles that were to be replaced when last seen
};

}  // namespace tessera
