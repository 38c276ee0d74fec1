// Selects which tiles to draw, and which to hold in memory (City-on-Web, section 4.5).
//
// The image is drawn from a cut through the tree: tiles that together cover what the root covers, each place exactly
// once. A tile is replaced by its children while its screen-space error exceeds a threshold in pixels; once replaced,
// it stays replaced until the error has fallen below the threshold by the factor `hysteresis`. If a tile of the cut is
// not in memory, its nearest resident ancestor is drawn in that tile's cells.
//
// The tiles requested in memory are chosen again for each view: the most urgent first, as far as the budget allows. The
// ancestors of a requested tile are requested too, so that whatever comes into view can be drawn from an ancestor at
// once.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "render/tile_frame.h"
#include "render/tile_tree.h"
#include "scene/camera.h"

namespace tessera {

inline constexpr double kUsualHysteresis = 1.2;

struct SelectionSettings {
  double maximumScreenSpaceError = 1.5;  // pixels of geometric error; 0: the finest tiles everywhere
  // Also the factor by which resident tiles are preferred. 0: that of the drawer (selectionFor), or kUsualHysteresis.
  double hysteresis = 0;
  int finestLevel = 0;  // tiles of this level and finer are never replaced
};

// What a camera sees of a scene, in scene units.
struct TileView {
  Vec3d eye = Vec3d::Zero();
  Mat3d cameraFromScene = Mat3d::Identity();  // a rotation
  double focal = 1;                           // pixels
  double pixels = 1;                          // of the whole image
  double backgroundBlockPixels = 1;           // number of pixels that may show the background block
  double nearest = 0.05;                      // smaller distances count as this one
  // The image's extent in x/z and y/z; nothing if the lens may see in any direction.
  struct Window {
    double low[2], high[2];
  };
  std::optional<Window> window;

  bool sees(const TileNode& tile) const;  // true for every visible tile, and for few others
  // Distance to the tile's box. For the background block: to its nearest part beyond the sides of the scene's box,
  // because the space above the box is sky and the ground hides the space below.
  double distance(const TileNode& tile) const;
  double errorInPixels(const TileNode& tile) const;
  double areaInPixels(const TileNode& tile) const;  // upper bound of the area that the tile covers
};

TileView tileView(const Camera& camera, const Pose& worldFromCamera, const TileFrame& frame);

// Returns whether a ray shows the relevant part of the background block: it misses the scene's box or leaves it through
// a side. The space above is sky, and the ground hides the space below.
bool showsBackgroundBlock(const SceneRay& ray, const Vec3d& low, const Vec3d& high);

// What a selection is based on: the memory budget, the resident tiles and the sizes of tiles.
struct TileMemory {
  uint64_t budget = 0;                      // bytes
  std::function<bool(int tile)> holds;      // always true for the coarsest tiles, including the background block's
  std::function<uint64_t(int tile)> bytes;  // without its resources
  // Resources that a tile shares with others, each once. Each is charged to the first tile that needs it.
  std::function<std::vector<int>(int tile)> tileResources = [](int) { return std::vector<int>(); };
  std::function<uint64_t(int resource)> bytesOfResource = [](int) { return uint64_t{0}; };
};

struct SelectedTile {
  int tile = 0;      // the tile whose cells are drawn
  int content = -1;  // the tile whose content is drawn: `tile` or one of its ancestors
  bool visible = true;
};

struct TileCut {
  std::vector<SelectedTile> tiles;  // front to back for every ray of the view
  int backgroundBlock = -1;         // the background block to draw behind the tiles
};

struct TileChoice {
  std::vector<int> requested;  // tiles to hold in memory besides the coarsest, the most urgent first
  int refused = 0;             // tiles that do not fit into the budget
};

class TileSelector {
 public:
  // Keeps a reference to `tree`.
  TileSelector(const TileTree& tree, SelectionSettings settings);

  // Returns which tiles to hold in memory for a view.
  TileChoice choose(const TileView& view, const TileMemory& memory);
  // `holds` says which contents are in memory; the coarsest, including the background block's, always are.
  TileCut cut(const TileView& view, const std::function<bool(int)>& holds);

 private:
  struct Pass;
  void cover(Pass& pass, int tile, int above);
  bool isReplaced(const TileView& view, int tile);
  void lookBelow(const TileView& view, int tile);

  const TileTree& tree_;
  SelectionSettings settings_;
  std::vector<int> pinned_;     // the coarsest tiles, including the background block's
  std::vector<char> replaced_;  // whether a tile was to be replaced when it was last seen
};

}  // namespace tessera
