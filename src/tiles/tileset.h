// A scene as a tree of tiles: tileset.json (3D Tiles 1.1) in memory. One form for all representations.
// docs/tile-format.md is normative. Writing and reading: tileset_json.h, scene_folder.h.
//
// Frames: `scene` has the axes of scene/block_grid.h with half a finest block's edge as 1 (payloads and this struct
// speak in it); `world` is the capture's; `tile` is that of tileset.json's boxes: metres east, north and up where the
// capture is georeferenced, the world elsewhere.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scene/block_grid.h"
#include "scene/capture.h"

namespace tessera {

// x ↦ scale · rotation · x + translation.
struct Similarity {
  Mat3d rotation = Mat3d::Identity();
  double scale = 1;
  Vec3d translation = Vec3d::Zero();

  Vec3d operator*(const Vec3d& x) const { return scale * (rotation * x) + translation; }
  Vec3d undo(const Vec3d& x) const { return rotation.transpose() * (x - translation) / scale; }
  Mat4d matrix() const;
};

struct SceneBox {  // scene units, along the scene's axes
  Vec3d low = Vec3d::Constant(-1), high = Vec3d::Constant(1);

  bool contains(const SceneBox& other) const {
    return (low.array() <= other.low.array()).all() && (other.high.array() <= high.array()).all();
  }
};

// Cells of the block grid from `first` to before `end`, as (i along x, j along y).
struct CellRange {
  std::array<uint32_t, 2> first = {0, 0}, end = {1, 1};

  uint64_t cells() const { return uint64_t{end[0] - first[0]} * (end[1] - first[1]); }
  bool contains(const CellRange& other) const;
  bool operator==(const CellRange&) const = default;
};

// A file that several contents need: a network, a table.
struct SharedResource {
  std::string uri;       // relative to the folder of tileset.json
  std::string mimeType;  // "application/octet-stream", "model/gltf-binary", ...
  uint64_t bytes = 0;    // of the file, 0 when not known; a hint
};

struct TileContent {
  std::string uri;  // relative to the folder of tileset.json; ends in .glb
  // What it stands for: the tile's, or with several contents a piece of it. They lie on a grid as children do, so that
  // they too have an order (contents of `mesh` need none, and may overlap).
  CellRange cells;
  SceneBox box;  // all of it lies inside; of the surround the far box, which holds the scene's
  // What lies outside the scene's box: in the root, one of a level at most. One of them is drawn, behind everything
  // else; never culled.
  bool surround = false;
  std::vector<uint32_t> resources;  // of Tileset::resources, that it cannot be drawn without
  uint64_t bytes = 0;               // of the file, 0 when not known; a hint
  // Of a surround, as a tile has them. Its texels are smallest at the scene's box; the error is theirs there.
  uint32_t level = 0;
  double geometricError = 0;
};

struct Tile {
  uint32_t level = 0;  // 0 is the finest; a child's is lower than its parent's
  CellRange cells;     // what it stands for; its children's together are the same
  // Its contents and those below it lie inside, the surround apart. It keeps to its cells' walls, those at the border
  // of the grid apart (blocks there may own what lies outside), and may be lower than they are.
  SceneBox box;
  double geometricError = 0;       // metres: of drawing it instead of what it was baked from; no more than its parent's
  std::vector<uint32_t> children;  // of Tileset::tiles, each after its parent; none for a leaf
  // One with none (the surround apart) and with children cannot stand for them. A leaf with none is empty.
  std::vector<TileContent> contents;

  bool hasContents() const;  // the surround apart
  bool isDrawable() const;   // stands for all below it
};

struct Tileset {
  // What decodes and draws the contents: lower-case letters, digits and '_'. Which names are known is for whoever has
  // their codecs (tiles/content.h).
  std::string representation;
  std::string name;  // of the capture, for people

  Similarity worldFromScene;
  Mat4d sourceFromWorld = Mat4d::Identity();  // as Capture's: camera paths speak of the source's world
  std::optional<GeoFrame> georeference;

  // Cell (i, j) holds x in [2i - columns, 2i + 2 - columns], y likewise; the box is [-columns, columns] × [-rows, rows]
  // × [bottom, top].
  uint32_t columns = 1, rows = 1;
  double bottom = -1, top = 1;                  // in [-1,1]
  double near = 0.05;                           // scene units: nothing was trained nearer to a camera than this
  std::array<float, 3> background = {0, 0, 0};  // behind everything, in the colours of the photos

  uint32_t levels = 1;
  double geometricError = 0;  // metres: of drawing nothing at all; at least the root's
  std::vector<SharedResource> resources;
  std::vector<Tile> tiles;  // the root first

  const Tile& root() const { return tiles.front(); }
  SceneBox box() const;
  SceneBox boxOf(const CellRange& cells) const;  // between bottom and top
  CellRange allCells() const { return {{0, 0}, {columns, rows}}; }
  BlockGrid blockGrid() const;

  Similarity tileFromScene() const;  // metres, if the scene has a scale
  Mat4d rootTransform() const;       // of the tile frame: to ECEF where georeferenced, else the identity

  std::array<uint32_t, 2> cellAt(const Vec3d& xInScene) const;  // clamped to the border
};

// Cells between the cell and the range, along both axes together; 0 inside. Ranges on a grid (children of a tile), in
// the order of this, are front to back for every ray from the cell: a ray that passes from one to the next moves away
// from it along one axis and keeps the range of the other.
uint32_t cellsBetween(const std::array<uint32_t, 2>& cell, const CellRange& range);

// The children of a tile, front to back for every ray from `xInScene`; the first in the list first among equals (no ray
// meets both). A cut of the tree is ordered by doing so from the root downwards.
std::vector<uint32_t> childrenFrontToBack(const Tileset& tileset, uint32_t tile, const Vec3d& xInScene);

// The coarsest tiles that stand for the whole scene: the root, or what lies below it where that is not drawable.
std::vector<uint32_t> coarsestCover(const Tileset& tileset);

// The highest level of a tile that has contents, the surround apart; 0 where there is none.
uint32_t coarsestLevel(const Tileset& tileset);

// Scene units from a block grid's: columns, rows, bottom, top and worldFromScene. The scene's origin is amid its
// heights, wherever the grid's is.
void placeOn(Tileset& tileset, const BlockGrid& grid);

// Why the tileset is none: the first rule of docs/tile-format.md that it breaks, for people. Nothing when it is one.
std::optional<std::string> brokenRule(const Tileset& tileset);

// Whether the contents of each tile, the surround apart, lie on a grid as children do, so that they have an order in
// front of every camera. The first tile whose contents do not; nothing where all do. Contents of representations whose
// codec lets them overlap need no order.
std::optional<uint32_t> tileWithoutOrder(const Tileset& tileset);

}  // namespace tessera
