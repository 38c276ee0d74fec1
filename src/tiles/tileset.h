// A scene as a tree of tiles: tileset.json (3D Tiles 1.1) in memory, the same for all representations.
// docs/tile-format.md is normative. tileset_json.h and scene_folder.h write and read it.
//
// Frames: `scene` has the axes of scene/block_grid.h and half the edge of a finest block as its unit (payloads and this
// struct use it); `world` is the capture's; `tile` is the frame of the boxes in tileset.json: metres east, north and up
// if the capture is georeferenced, otherwise the world.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "scene/block_grid.h"
#include "scene/capture.h"
#include "scene/exposure_response.h"
#include "scene/surface_coverage.h"

namespace tessera {

// The map x ↦ scale · rotation · x + translation.
struct Similarity {
  Mat3d rotation = Mat3d::Identity();
  double scale = 1;
  Vec3d translation = Vec3d::Zero();

  Vec3d operator*(const Vec3d& x) const { return scale * (rotation * x) + translation; }
  Vec3d undo(const Vec3d& x) const { return rotation.transpose() * (x - translation) / scale; }
  Mat4d matrix() const;
};

struct SceneBox {  // in scene units, along the scene's axes
  Vec3d low = Vec3d::Constant(-1), high = Vec3d::Constant(1);

  bool contains(const SceneBox& other) const {
    return (low.array() <= other.low.array()).all() && (other.high.array() <= high.array()).all();
  }
};

// The half-open range [first, end) of cells of the block grid, as (i along x, j along y).
struct CellRange {
  std::array<uint32_t, 2> first = {0, 0}, end = {1, 1};

  uint64_t cells() const { return uint64_t{end[0] - first[0]} * (end[1] - first[1]); }
  bool contains(const CellRange& other) const;
  bool operator==(const CellRange&) const = default;
};

// A file that several contents need: a network or a table.
struct SharedResource {
  std::string uri;       // relative to the folder of tileset.json
  std::string mimeType;  // "application/octet-stream", "model/gltf-binary", ...
  uint64_t bytes = 0;    // of the file, 0 if not known; a hint
};

struct TileContent {
  std::string uri;  // relative to the folder of tileset.json; ends in .glb
  // The cells that it covers: the tile's, or a part of them if the tile has several contents. Those lie on a grid as
  // children do, so that they too can be ordered (contents of `mesh` need no order and may overlap).
  CellRange cells;
  SceneBox box;  // contains the whole content; for a background block it is the far box, which contains the scene's
  // Whether it covers what lies outside the scene's box. Such contents are in the root, at most one for each level. One
  // of them is drawn, behind everything else, and is never culled.
  bool backgroundBlock = false;
  std::vector<uint32_t> resources;  // indices into Tileset::resources; the content cannot be drawn without them
  uint64_t bytes = 0;               // of the file, 0 if not known; a hint
  // Level and error of a background block, as those of a tile. Its texels are smallest at the scene's box; the error is
  // theirs there.
  uint32_t level = 0;
  double geometricError = 0;
};

struct Tile {
  uint32_t level = 0;  // 0 is the finest; a child's level is lower than its parent's
  CellRange cells;     // the cells that it covers, which its children together cover too
  // Contains its contents and those below it, except the background block. Unless contents may overlap, it stays within
  // the walls of its cells, except at the border of the grid (blocks there may own what lies outside). It may be lower
  // than they are.
  SceneBox box;
  double geometricError =
      0;  // metres: error of drawing this tile instead of what it was baked from; at most its parent's
  std::vector<uint32_t> children;  // indices into Tileset::tiles, each after its parent; empty for a leaf
  // A tile with children but without contents (not counting the background block) cannot stand for them. A leaf without
  // contents is empty.
  std::vector<TileContent> contents;

  bool hasContents() const;  // not counting the background block
  bool isDrawable() const;   // whether it can be drawn in place of everything below it
};

struct Tileset {
  // The representation of the contents: lower-case letters, digits and '_'. Which names are known depends on the codecs
  // that are available (tiles/content.h).
  std::string representation;
  std::string name;  // of the capture, for people

  Similarity worldFromScene;
  Mat4d sourceFromWorld = Mat4d::Identity();  // as Capture's: camera paths are given in the source's world
  std::optional<GeoFrame> georeference;

  // Cell (i, j) covers x in [2i - columns, 2i + 2 - columns] and, likewise, y in [2j - rows, 2j + 2 - rows]; the
  // scene's box is [-columns, columns] × [-rows, rows] × [bottom, top].
  uint32_t columns = 1, rows = 1;
  double bottom = -1, top = 1;                  // in [-16,16]
  double near = 0.05;                           // scene units: nothing closer to a camera than this was trained
  std::array<float, 3> background = {0, 0, 0};  // colour behind everything, in the colour space of the photos

  uint32_t levels = 1;
  double geometricError = 0;  // metres: error of drawing nothing at all; at least the root's
  std::vector<SharedResource> resources;
  std::vector<SurfaceCoverage> coverage;  // of the finest level, for people; empty if it was not checked
  // How colours follow the exposure of a photo, for programs that compare; nothing if it does not tell.
  std::optional<ExposureResponse> exposureResponse;
  std::vector<Tile> tiles;  // the root first

  const Tile& root() const { return tiles.front(); }
  SceneBox box() const;
  SceneBox boxFromCells(const CellRange& cells) const;  // between bottom and top
  CellRange allCells() const { return {{0, 0}, {columns, rows}}; }
  BlockGrid blockGrid() const;

  Similarity tileFromScene() const;  // to metres, if the scene has a scale
  Mat4d rootTransform() const;       // of the tile frame: to ECEF if georeferenced, otherwise the identity

  std::array<uint32_t, 2> cellAt(const Vec3d& xInScene) const;  // clamped to the grid
};

// Returns the number of cells between a cell and a range, summed over both axes; 0 inside. Sorting ranges on a grid
// (the children of a tile) by it gives an order that is front to back for every ray from the cell: a ray that passes
// from one range to the next moves away from the cell along one axis and stays in the same range along the other.
uint32_t cellsBetween(const std::array<uint32_t, 2>& cell, const CellRange& range);

// Returns the children of a tile, front to back for every ray from `xInScene`; ties are in the order of the list, as no
// ray meets both. Applying this from the root downwards orders a cut of the tree.
std::vector<uint32_t> childrenFrontToBack(const Tileset& tileset, uint32_t tile, const Vec3d& xInScene);

// Returns the coarsest tiles that cover the whole scene: the root, or its descendants where it is not drawable.
std::vector<uint32_t> coarsestCover(const Tileset& tileset);

// Returns whether some content shows what lies outside of the scene's box: a background block, or a block at the border
// that reaches farther than the edge of a block beyond it.
bool showsOutside(const Tileset& tileset);

// Returns the highest level of a tile with contents, not counting the background block; 0 if there is none.
uint32_t coarsestLevel(const Tileset& tileset);

// Sets columns, rows, bottom, top and worldFromScene from a block grid. The scene's origin is at the middle of its
// height range, wherever the grid's origin is.
void placeOn(Tileset& tileset, const BlockGrid& grid);

// Returns the first rule of docs/tile-format.md that its frames, its grid, its background or its georeference violate,
// for people, or nothing: what is known before there are tiles.
std::optional<std::string> frameError(const Tileset& tileset);

// Returns the first rule of docs/tile-format.md that the tileset violates, for people, or nothing if it is valid.
std::optional<std::string> validationError(const Tileset& tileset);

// Returns the first tile whose contents, except the background block, do not lie on a grid as children do and so cannot
// be ordered front to back for every camera; nothing if all do. Contents need no order in representations whose codec
// lets them overlap.
std::optional<uint32_t> tileWithoutOrder(const Tileset& tileset);
// Returns the first tile whose box crosses a wall of its cells that is inside the grid; nothing if none does. Boxes may
// do so where contents may overlap.
std::optional<uint32_t> tileBeyondItsCells(const Tileset& tileset);

}  // namespace tessera
