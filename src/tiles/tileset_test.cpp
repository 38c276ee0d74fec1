#include "tiles/tileset.h"

#include <gtest/gtest.h>

#include <GeographicLib/Geocentric.hpp>
#include <GeographicLib/LocalCartesian.hpp>
#include <cstdlib>
#include <functional>

#include "base/random.h"
#include "tiles/testing/test_tileset.h"

namespace tessera {
namespace {

using tiles_test::testTileset;

TEST(Tileset, StandsOnItsBlockGrid) {
  BlockGrid grid;
  grid.originInWorld = {10, 20, 3};
  grid.gridFromWorld << 0.8, 0.6, 0, -0.6, 0.8, 0, 0, 0, 1;
  grid.edge = 30;
  grid.columns = 3;
  grid.rows = 2;
  grid.bottom = -6;
  grid.top = 12;
  Tileset tileset;
  placeOn(tileset, grid);
  const Vec3d corner = tileset.worldFromScene * Vec3d(-3, -2, tileset.top);
  EXPECT_LT((corner - grid.inWorld({-45, -30, 12})).norm(), 1e-9);
  EXPECT_LT((tileset.worldFromScene.undo(corner) - Vec3d(-3, -2, tileset.top)).norm(), 1e-12);
  const BlockGrid again = tileset.blockGrid();
  EXPECT_EQ(again.originInWorld, grid.inWorld({0, 0, 3})) << "amid its heights";
  EXPECT_EQ(again.gridFromWorld, grid.gridFromWorld);
  EXPECT_EQ(again.edge, grid.edge);
  EXPECT_EQ(again.columns, 3);
  EXPECT_EQ(again.rows, 2);
  EXPECT_DOUBLE_EQ(again.bottom, -9);
  EXPECT_DOUBLE_EQ(again.top, 9);
}

TEST(Tileset, HasTheCellsOfItsBlockGrid) {
  const Tileset tileset = testTileset();
  const BlockGrid grid = tileset.blockGrid();
  for (double x = -5; x <= 5; x += 0.37) {
    for (double y = -5; y <= 5; y += 0.41) {
      const Vec3d inGrid = grid.inGrid(tileset.worldFromScene * Vec3d(x, y, 0));
      const auto cell = tileset.cellAt({x, y, 0});
      EXPECT_EQ(static_cast<int>(cell[0] + tileset.columns * cell[1]), grid.cellAt(inGrid.head<2>())) << x << " " << y;
    }
  }
}

TEST(Tileset, TheRootTransformPutsItOnTheEarth) {
  const Tileset tileset = testTileset();
  const Vec3d xInScene(0.3, -1.2, 0.5), xInWorld = tileset.worldFromScene * xInScene;
  const Vec3d enu = (tileset.georeference->enuFromWorld * xInWorld.homogeneous()).head<3>();
  EXPECT_LT((tileset.tileFromScene() * xInScene - enu).norm(), 1e-9);
  const auto& geo = *tileset.georeference;
  double latitude, longitude, height;
  GeographicLib::LocalCartesian(geo.latitude, geo.longitude, geo.altitude)
      .Reverse(enu.x(), enu.y(), enu.z(), latitude, longitude, height);
  Vec3d ecef;
  GeographicLib::Geocentric::WGS84().Forward(latitude, longitude, height, ecef.x(), ecef.y(), ecef.z());
  EXPECT_LT(((tileset.rootTransform() * enu.homogeneous()).head<3>() - ecef).norm(), 1e-6);
  EXPECT_EQ(testTileset(3, false).rootTransform(), Mat4d::Identity());
}

// Finds by dense sampling where the ray from o along d is in each tile of a cut.
TEST(Tileset, ChildrenAreFrontToBackForEveryRay) {
  // Three columns and two rows of ranges of unequal width, as merging an odd grid leaves them.
  Tileset tileset = testTileset(5);
  Tile& root = tileset.tiles[0];
  root.children.clear();
  tileset.tiles.resize(1);
  for (const auto& [j0, j1] : {std::pair{0u, 1u}, {1u, 2u}}) {
    for (const auto& [i0, i1] : {std::pair{0u, 2u}, {2u, 4u}, {4u, 5u}}) {
      Tile child;
      child.cells = {{i0, j0}, {i1, j1}};
      child.box = tileset.boxFromCells(child.cells);
      tileset.tiles[0].children.push_back(static_cast<uint32_t>(tileset.tiles.size()));
      tileset.tiles.push_back(child);
    }
  }
  ASSERT_EQ(validationError(tileset), std::nullopt);
  const RandomStream random(5, 5);
  size_t changes = 0;
  for (uint64_t ray = 0; ray < 500; ++ray) {
    const auto draw = [&](uint64_t k) { return 2 * random.uniformDouble(8 * ray + k) - 1; };
    const Vec3d origin(8 * draw(0), 5 * draw(1), draw(2)), direction(draw(3), draw(4), draw(5));
    const auto order = childrenFrontToBack(tileset, 0, origin);
    size_t last = 0;
    for (double t = 0; t < 40; t += 0.01) {
      const auto cell = tileset.cellAt(origin + t * direction);
      size_t place = 0;
      while (!tileset.tiles[order[place]].cells.contains({cell, {cell[0] + 1, cell[1] + 1}})) ++place;
      EXPECT_GE(place, last) << "ray " << ray;
      changes += place != last;
      last = place;
    }
  }
  EXPECT_GT(changes, 500u);
}

TEST(Tileset, TheCoarsestCoverLiesBelowARootThatCannotStandForIt) {
  Tileset tileset = testTileset(2);
  EXPECT_EQ(coarsestCover(tileset), std::vector<uint32_t>{0});
  tileset.tiles[0].contents.erase(tileset.tiles[0].contents.begin());  // only the background blocks are left
  EXPECT_EQ(validationError(tileset), std::nullopt);
  EXPECT_EQ(coarsestCover(tileset), (std::vector<uint32_t>{1, 2, 3, 4}));
}

TEST(Tileset, ShowsWhatLiesOutsideByABackgroundBlockOrByBlocksAtTheBorder) {
  Tileset tileset = testTileset(2);
  EXPECT_TRUE(showsOutside(tileset));
  for (Tile& tile : tileset.tiles)
    std::erase_if(tile.contents, [](const TileContent& content) { return content.backgroundBlock; });
  EXPECT_FALSE(showsOutside(tileset));
  tileset.tiles[1].contents[0].box.low.x() = -100;
  EXPECT_TRUE(showsOutside(tileset));
}

TEST(Tileset, ItsCoarsestLevelIsOneThatHasContentsOfItsOwn) {
  Tileset tileset = testTileset(2);
  EXPECT_EQ(coarsestLevel(tileset), 1u);
  tileset.tiles[0].contents.erase(tileset.tiles[0].contents.begin());  // only the background blocks are left
  EXPECT_EQ(coarsestLevel(tileset), 0u);
  EXPECT_EQ(tileset.levels, 2u);
}

TEST(Tileset, AllowsChainsAndSeveralContents) {
  Tileset tileset = testTileset(2);
  tileset.levels = 3;
  Tile top = tileset.tiles[0];  // over the same cells
  top.level = 2;
  top.children = {1};
  tileset.tiles[0].contents.resize(1);
  for (uint32_t& child : tileset.tiles[0].children) ++child;
  tileset.tiles.insert(tileset.tiles.begin(), top);
  EXPECT_EQ(validationError(tileset), std::nullopt);
  TileContent west = tileset.tiles[1].contents[0], east = west;
  west.cells = {{0, 0}, {1, 2}};
  east.cells = {{1, 0}, {2, 2}};
  tileset.tiles[1].contents = {west, east};
  EXPECT_EQ(validationError(tileset), std::nullopt);
  EXPECT_EQ(tileWithoutOrder(tileset), std::nullopt);
  tileset.tiles[1].contents[1].cells = west.cells;
  EXPECT_EQ(tileWithoutOrder(tileset), 1u);
  EXPECT_EQ(validationError(tileset), std::nullopt) << "whether contents may overlap is for their codec to say";
}

TEST(Tileset, FindsTilesThatReachBeyondTheirCells) {
  Tileset tileset = testTileset();
  EXPECT_EQ(tileBeyondItsCells(tileset), std::nullopt);
  tileset.tiles[1].box.high.x() += 0.1;
  EXPECT_EQ(tileBeyondItsCells(tileset), 1u);
  EXPECT_EQ(validationError(tileset), std::nullopt) << "whether contents may overlap is for their codec to say";
}

TEST(Tileset, NamesTheRuleThatIsBroken) {
  const auto names = [](const char* rule, const std::function<void(Tileset&)>& spoil) {
    Tileset tileset = testTileset();
    ASSERT_EQ(validationError(tileset), std::nullopt);
    spoil(tileset);
    EXPECT_EQ(validationError(tileset).value_or("none"), rule);
  };
  names("there are no tiles", [](Tileset& t) { t.tiles.clear(); });
  names("the number of levels is out of bounds", [](Tileset& t) { t.levels = 65; });
  names("the representation's name is not valid", [](Tileset& t) { t.representation.clear(); });
  names("the representation's name is not valid", [](Tileset& t) { t.representation = "../volume"; });
  names("the representation's name is not valid", [](Tileset& t) { t.representation = std::string(65, 'a'); });
  names("worldFromScene's rotation is not a rotation", [](Tileset& t) { t.worldFromScene.rotation.col(0) *= -1; });
  names("worldFromScene's scale is not above zero", [](Tileset& t) { t.worldFromScene.scale = 0; });
  names("worldFromScene's translation is out of bounds", [](Tileset& t) { t.worldFromScene.translation.x() = 1e13; });
  names("sourceFromWorld is not affine", [](Tileset& t) { t.sourceFromWorld(3, 0) = 1; });
  names("the grid's columns or rows are out of bounds", [](Tileset& t) { t.columns = 0; });
  names("the grid's heights are not within -16 and 16", [](Tileset& t) { t.bottom = t.top; });
  names("near is not between 0 and 1", [](Tileset& t) { t.near = -1; });
  names("the background is not a colour", [](Tileset& t) { t.background[1] = 1.5f; });
  names("the georeference is not a place on the Earth", [](Tileset& t) { t.georeference->latitude = 91; });
  names("the georeference's enuFromWorld is not a similarity",
        [](Tileset& t) { t.georeference->enuFromWorld(0, 0) *= 2; });
  names("the uri of a shared resource is not plain", [](Tileset& t) { t.resources[0].uri = "../a"; });
  names("a shared resource is listed twice", [](Tileset& t) { t.resources.push_back(t.resources[0]); });
  names("a shared resource has no mimeType", [](Tileset& t) { t.resources[0].mimeType.clear(); });
  names("the tileset's geometric error is below its root's", [](Tileset& t) { t.geometricError = 0.1; });
  names("the root does not cover all cells", [](Tileset& t) { t.tiles[0].cells.end[0] = 2; });
  names("the tiles are not a tree", [](Tileset& t) { t.tiles[1].children = {1}; });
  names("the tiles are not a tree", [](Tileset& t) { t.tiles[1].children = {2}; });
  names("the tiles are not a tree", [](Tileset& t) { t.tiles[0].children.pop_back(); });
  names("the tiles are not a tree", [](Tileset& t) { t.tiles[0].children.push_back(99); });
  names("tile 0: its level is not below the scene's number of levels", [](Tileset& t) { t.tiles[0].level = 2; });
  names("tile 2: its cells are not within the grid", [](Tileset& t) { t.tiles[2].cells.end[0] = 4; });
  names("tile 1: its box is empty or out of bounds", [](Tileset& t) { t.tiles[1].box.low.x() = NAN; });
  names("tile 1: its geometric error is not a length", [](Tileset& t) { t.tiles[1].geometricError = -1; });
  names("tile 0: a child is not of a finer level", [](Tileset& t) { t.tiles[1].level = 1; });
  names("tile 0: a child's box is not within its own", [](Tileset& t) { t.tiles[1].box.low.z() -= 1; });
  names("tile 0: a child's geometric error is above its own", [](Tileset& t) { t.tiles[1].geometricError = 1; });
  names("tile 0: its children do not lie on a grid", [](Tileset& t) { t.tiles[1] = t.tiles[2]; });
  names("tile 0: its children do not lie on a grid", [](Tileset& t) {
    t.tiles[1].cells.end[0] = 2;
    t.tiles[1].box.high.x() = 0;
  });
  names("tile 0: its children do not cover its cells", [](Tileset& t) {
    t.tiles[0].children.pop_back();
    t.tiles.pop_back();
  });
  names("tile 0: a content's uri is not the plain name of a .glb file",
        [](Tileset& t) { t.tiles[0].contents[0].uri = "a.b3dm"; });
  names("tile 0: a content's box is empty or out of bounds",
        [](Tileset& t) { t.tiles[0].contents[0].box.high.y() = -5; });
  names("tile 0: a content's box is not within its tile's",
        [](Tileset& t) { t.tiles[0].contents[0].box.high.y() = 5; });
  names("tile 1: a content's cells are not within its tile's",
        [](Tileset& t) { t.tiles[1].contents[0].cells.end[0] = 2; });
  names("tile 0: a content needs a shared resource that is not listed", [](Tileset& t) { t.resources.clear(); });
  names("tile 0: a content needs a shared resource twice", [](Tileset& t) {
    t.tiles[0].contents[0].resources = {0, 0};
  });
  names("tile 1: a background block is not in the root",
        [](Tileset& t) { t.tiles[1].contents[0].backgroundBlock = true; });
  names("tile 0: two background blocks have the same level",
        [](Tileset& t) { t.tiles[0].contents[2].level = t.tiles[0].contents[1].level; });
  names("tile 0: a background block's level is not below the scene's number of levels",
        [](Tileset& t) { t.tiles[0].contents[1].level = 2; });
  names("tile 0: a background block's geometric error is not a length",
        [](Tileset& t) { t.tiles[0].contents[1].geometricError = NAN; });
  names("tile 0: a background block's geometric error is below a finer one's",
        [](Tileset& t) { t.tiles[0].contents[1].geometricError = 1; });
  names("tile 0: the background block's box does not contain the scene's",
        [](Tileset& t) { t.tiles[0].contents[1].box.high.z() = 0; });
}

}  // namespace
}  // namespace tessera
