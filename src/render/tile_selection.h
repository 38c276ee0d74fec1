// Which tiles to draw (City-on-Web, section 4.5; algorithms' section 9): a cut through the tree, whose tiles together
// cover what the root covers, each place once.
//
// A tile is replaced by its children while its error, projected, is above a number of pixels, and all of them that can
// be seen are in memory. Once it is to be replaced, it stays so until the error is smaller by `hysteresis`.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "render/tile_tree.h"
#include "render/volume_frame.h"
#include "scene/camera.h"

namespace tessera {

struct SelectionSettings {
  double mostPixels = 1.5;  // of geometric error; 0: the finest everywhere
  double hysteresis = 1.2;
  int finestLevel = 0;  // tiles of this level and finer are never replaced
};

// What a camera sees of a scene, in its units.
struct TileView {
  Vec3d eye = Vec3d::Zero();
  Mat3d cameraFromScene = Mat3d::Identity();  // a rotation
  double focal = 1;                           // pixels
  double pixels = 1;                          // of the whole picture
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

TileView tileView(const Camera& camera, const Pose& worldFromCamera, const VolumeFrame& frame);

struct SelectedTile {
  int tile = 0;
  bool visible = true;  // what is not, or has no content, need not be in memory
};

// Tiles that must be loaded together for the cut to change.
struct TileRequest {
  std::vector<int> tiles;
  std::vector<int> beside;  // in memory, and drawn with them: not to be evicted for them
  double priority = 0;      // the area on the screen of what they would replace × its error in units of mostPixels
  double distance = 0;
};

struct Selection {
  std::vector<SelectedTile> cut;      // front to back for every ray of the view
  int surround = -1;                  // the one to draw behind them
  std::vector<TileRequest> requests;  // the most urgent first
};

class TileSelector {
 public:
  // Keeps a reference to `tree`.
  TileSelector(const TileTree& tree, SelectionSettings settings);

  // `loaded` says which contents are in memory; the coarsest, also of the surround, always are.
  Selection select(const TileView& view, const std::function<bool(int)>& loaded);

 private:
  struct Pass;
  bool cover(Pass& pass, int tile, std::vector<int>& missing);

  const TileTree& tree_;
  SelectionSettings settings_;
  std::vector<char> replaced_;  // tiles that were to be replaced when last seen
};

}  // namespace tessera
