#include "partition/block_map.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "partition/block_geography.h"
#include "partition/testing/test_captures.h"

namespace tessera {
namespace {

using nlohmann::json;

Capture field() {
  Capture capture = flight(10, 8, 20, 60);
  addPoints(capture, 5000, {-20, -20, -0.1}, {200, 160, 0.1});
  capture.photos[7].split = Split::test;
  return capture;
}

// At 50° N a degree of latitude is 111 229 m long, one of longitude 71 696 m.
Capture fieldOnEarth() {
  Capture capture = field();
  capture.geo = GeoFrame{.latitude = 50, .longitude = 8, .altitude = 200};
  return capture;
}

size_t countOccurrences(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

class Folder {
 public:
  Folder() : path_(fs::temp_directory_path() / ("tessera-block-map-" + std::to_string(::getpid()))) {
    fs::remove_all(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

TEST(BlockMap, ShowsEveryCellCameraAndCount) {
  const Capture capture = field();
  const Partition partition = partitionCapture(capture, {.blocks = {false, 3, 2}});
  const std::string svg = blockMapSvg(capture, partition);
  EXPECT_EQ(countOccurrences(svg, "class=\"cell\""), 6u);
  EXPECT_EQ(countOccurrences(svg, "class=\"camera\" cx"), 79u + 1);  // plus one in the legend
  EXPECT_EQ(countOccurrences(svg, "class=\"other\" cx"), 1u + 1);
  EXPECT_EQ(countOccurrences(svg, "class=\"hull\" points"), 1u);
  EXPECT_NE(svg.find(">2, 1</text>"), std::string::npos);
  EXPECT_NE(svg.find(">" + std::to_string(partition.coverage[5].photos) + " photos</text>"), std::string::npos);
  EXPECT_EQ(countOccurrences(svg, "class=\"thin\""), 0u);
  EXPECT_EQ(countOccurrences(svg, "class=\"north\""), 0u);
  EXPECT_NE(svg.find("50 units</text>"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("<!--"), std::string::npos);
  EXPECT_EQ(countOccurrences(svg, "<g"), countOccurrences(svg, "</g>"));
}

TEST(BlockMap, MarksThinCells) {
  const Capture capture = field();
  Partition partition = partitionCapture(capture, {.blocks = {false, 3, 2}});
  partition.thin = {{4, "sentence"}};
  const std::string svg = blockMapSvg(capture, partition);
  EXPECT_EQ(countOccurrences(svg, "class=\"thin\" x"), 1u);
  EXPECT_NE(svg.find("1 blocks have too little"), std::string::npos);
}

TEST(BlockMap, PointsNorth) {
  Capture capture = fieldOnEarth();
  EXPECT_NE(blockMapSvg(capture, partitionCapture(capture, {.blocks = {false, 3, 2}})).find("rotate(0.0)"),
            std::string::npos);
  // The world is rotated against the Earth: its x, which points to the right in the map, is north.
  capture.geo->enuFromWorld.topLeftCorner<3, 3>() = turnAbout(Vec3d::UnitZ(), 90);
  const std::string svg = blockMapSvg(capture, partitionCapture(capture, {.blocks = {false, 3, 2}}));
  EXPECT_NE(svg.find("rotate(90.0)"), std::string::npos) << svg.substr(svg.find("north"), 200);
  EXPECT_NE(svg.find("50 m</text>"), std::string::npos);
}

TEST(BlockMap, OmitsTheOutlineWhenCamerasDoNotLookAtTheGround) {
  const Capture capture = orbit({0, 0, 1}, 4, 12);
  const std::string svg = blockMapSvg(capture, partitionCapture(capture, {.blocks = {false, 1, 1}}));
  EXPECT_EQ(countOccurrences(svg, "class=\"hull\""), 0u);
  EXPECT_EQ(countOccurrences(svg, "class=\"cell\""), 1u);
}

TEST(BlockMap, IsWrittenWithGeoJsonOnlyWithAGeoReference) {
  const Folder folder;
  const Capture capture = field(), onEarth = fieldOnEarth();
  EXPECT_FALSE(writeBlockMap(folder.path(), capture, partitionCapture(capture, {})));
  EXPECT_TRUE(fs::exists(folder.path() / "blocks.svg"));
  EXPECT_FALSE(fs::exists(folder.path() / "blocks.geojson"));
  EXPECT_TRUE(writeBlockMap(folder.path(), onEarth, partitionCapture(onEarth, {})));
  EXPECT_EQ(json::parse(readTextFile(folder.path() / "blocks.geojson")).at("type"), "FeatureCollection");
}

TEST(BlocksAsGeoJson, AreSquaresOnTheGroundInDegrees) {
  const Capture capture = fieldOnEarth();
  Partition partition = partitionCapture(capture, {.blocks = {false, 3, 2}});
  partition.thin = {{4, "sentence"}};
  const json parsed = json::parse(blocksAsGeoJson(capture, partition).value());
  ASSERT_EQ(parsed.at("features").size(), 6u);
  const BlockGrid& grid = partition.grid;
  for (int cell = 0; cell < 6; ++cell) {
    const json& feature = parsed.at("features").at(cell);
    const json& ring = feature.at("geometry").at("coordinates").at(0);
    ASSERT_EQ(ring.size(), 5u);
    EXPECT_EQ(ring[0], ring[4]);
    double area = 0, east = 0, north = 0;
    for (int corner = 0; corner < 4; ++corner) {
      const double x0 = (ring[corner][0].get<double>() - 8) * 71696, y0 = (ring[corner][1].get<double>() - 50) * 111229;
      const double x1 = (ring[corner + 1][0].get<double>() - 8) * 71696;
      const double y1 = (ring[corner + 1][1].get<double>() - 50) * 111229;
      area += (x0 * y1 - x1 * y0) / 2;
      east += x0 / 4;
      north += y0 / 4;
    }
    EXPECT_NEAR(area, grid.edge * grid.edge, 0.01 * area);  // positive: counterclockwise
    const Vec3d middle = grid.inWorld({grid.centre(cell).x(), grid.centre(cell).y(), 0});
    EXPECT_NEAR(east, middle.x(), 0.5);
    EXPECT_NEAR(north, middle.y(), 0.5);
    const json& properties = feature.at("properties");
    EXPECT_EQ(properties.at("column"), cell % 3);
    EXPECT_EQ(properties.at("row"), cell / 3);
    EXPECT_EQ(properties.at("photos"), partition.coverage[static_cast<size_t>(cell)].photos);
    EXPECT_EQ(properties.at("thin"), cell == 4);
  }
}

TEST(PlaceOnEarth, IsTheOriginAtTheOriginAndMovesEastAndNorth) {
  const GeoFrame frame{.latitude = 50, .longitude = 8, .altitude = 200};
  const PlaceOnEarth origin = placeOnEarth(frame, Vec3d::Zero()), moved = placeOnEarth(frame, {717, 1112, 5});
  EXPECT_NEAR(origin.latitude, 50, 1e-12);
  EXPECT_NEAR(origin.longitude, 8, 1e-12);
  EXPECT_NEAR(origin.altitude, 200, 1e-6);
  EXPECT_NEAR(moved.longitude, 8.01, 1e-5);
  EXPECT_NEAR(moved.latitude, 50.01, 1e-5);
  EXPECT_NEAR(moved.altitude, 205, 0.5);
}

TEST(BlocksAsGeoJson, ContinueAcrossTheAntimeridian) {
  Capture capture = fieldOnEarth();
  capture.geo->longitude = 179.9999;
  const Partition partition = partitionCapture(capture, {.blocks = {false, 3, 2}});
  const json parsed = json::parse(blocksAsGeoJson(capture, partition).value());
  bool beyond = false;
  for (const json& feature : parsed.at("features")) {
    for (const json& corner : feature.at("geometry").at("coordinates").at(0)) {
      EXPECT_GT(corner[0].get<double>(), 179);
      beyond = beyond || corner[0].get<double>() > 180;
    }
  }
  EXPECT_TRUE(beyond);
}

}  // namespace
}  // namespace tessera
