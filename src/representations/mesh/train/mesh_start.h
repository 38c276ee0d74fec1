// Where the training of a mesh starts: a coarse field of the whole capture says which cells of each part may hold a
// surface, and which pixels of the photos show one.
#pragma once

#include "representations/field/train/field_model.h"
#include "representations/mesh/train/mesh_part.h"
#include "representations/mesh/train/stage_progress.h"
#include "train/photo_tiles.h"

namespace tessera {

class FieldRenderer;

// Photos are divided into tiles, the middle of each of which is looked at.
inline constexpr int kLeastTileEdge = 8;  // pixels of a photo
inline constexpr double kMaxTiles = 1 << 21;
// Returns the edge of a tile in pixels: kLeastTileEdge, or more if the training photos would have more tiles than
// kMaxTiles, for which neither memory nor time would suffice.
int tileEdge(const Capture& capture);

// Where the training of one part starts.
struct MeshStart {
  std::vector<bool> cells;           // [cells of the lattice] of the finest level
  std::vector<float> displacements;  // SurfaceSurvey::findDisplacements; empty: vertices start in the middle of cells
  std::vector<TileShares> tiles;     // [photo]; only training photos have some
  TileShares through;                // of a block, of all training photos: they show only what lies behind it
  double pixelWidth = 0;             // of a photo on the surfaces, the median, units of the part; 0: unknown

  // Nothing can be trained without both.
  bool isEmpty() const;
  double pixels() const;  // of the tiles
};

// What the training photos see of the coarse field, in the world.
class SurfaceSurvey {
 public:
  // `seesPoints`: for findDisplacements, which takes as many rays again. `onPhoto` counts the photos of all passes.
  SurfaceSurvey(const Capture& capture, FieldModel& coarse, bool seesPoints, const OnPhoto& onPhoto = kNobodyWatches);

  // Finds the cells of `domain`, of the part's finest level, in which there may be a surface, and the tiles whose
  // middles show one in the block or up to half of its margin beside it; outside: the tiles that show the sky, or a
  // surface that is not in front of the region. The tiles through a block are those whose middles' rays cross it, leave
  // it not through its bottom, and show nothing on this side of its grid's far end; neither do the tiles around them.
  MeshStart findStart(const MeshPart& part, const OctahedraDomain& domain) const;
  // Frees what findStart needs, about 100 bytes for each tile of a photo. It must not be called any more.
  void forgetTiles() { sights_ = {}; }
  // Returns the displacements of a block's vertices, [cells][3] in edges of a cell, to the mean of the points of
  // surfaces that photos show in the cell; zero if there are fewer than three.
  std::vector<float> findDisplacements(const MeshPart& part, const OctahedraDomain& domain) const;

 private:
  // A tile of a photo, and what its middle shows.
  struct Sight {
    PhotoTile tile;
    Vec3d eye, towards;     // the camera's centre and the direction of the middle, unit
    double distance = 0;    // of the surface, in world units
    bool isSurface = true;  // else the sky
    double pixelWidth = 0;  // on the surface, in world units
    double clear = 0;       // nothing is nearer in this tile and those around it, in world units
  };

  void addSights(int photo, const Camera& camera, const Pose& pose, int edge, FieldRenderer& renderer);
  void addSurface(const Photo& photo, const Camera& camera, double stride, FieldRenderer& renderer);
  // [cells of the lattice]: whether there may be a surface.
  std::vector<bool> findCells(const MeshPart& part, const OctahedraDomain& domain) const;
  // Whether photos see something in a box, in units of the coarse field's cells.
  bool showSomethingIn(const Vec3d& low, const Vec3d& high) const;

  SceneFrame frame_;  // of the coarse field
  MarchSpace space_;
  std::vector<uint32_t> cells_;  // of the coarse field, in which photos see something; bits
  std::vector<Sight> sights_;    // by photo
  std::vector<Vec3f> surface_;   // points that pixels of photos show, in the frame of the coarse field
  size_t photoCount_;
};

}  // namespace tessera
