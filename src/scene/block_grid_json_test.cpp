#include "scene/block_grid_json.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace tessera {
namespace {

using nlohmann::json;

BlockGrid someGrid() {
  BlockGrid grid;
  grid.originInWorld = {1.0 / 3, -2e5 / 7, 0.1};
  grid.gridFromWorld = (Eigen::AngleAxisd(0.3, Vec3d::UnitZ()) * Eigen::AngleAxisd(0.1, Vec3d::UnitX())).matrix();
  grid.edge = 100.0 / 7;
  grid.columns = 3;
  grid.rows = 5;
  grid.bottom = -1.0 / 9;
  grid.top = 2.0 / 9;
  return grid;
}

TEST(BlockGridJson, ReadsBackEveryBit) {
  const BlockGrid grid = someGrid();
  const auto read = blockGridFromJson(json::parse(blockGridToJson(grid).dump()));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->originInWorld, grid.originInWorld);
  EXPECT_EQ(read->gridFromWorld, grid.gridFromWorld);
  EXPECT_EQ(read->edge, grid.edge);
  EXPECT_EQ(read->columns, 3);
  EXPECT_EQ(read->rows, 5);
  EXPECT_EQ(read->bottom, grid.bottom);
  EXPECT_EQ(read->top, grid.top);
}

TEST(BlockGridJson, RequiresEveryKey) {
  const json whole = blockGridToJson(someGrid());
  for (const auto& [key, value] : whole.items()) {
    json part = whole;
    part.erase(key);
    EXPECT_FALSE(blockGridFromJson(part).has_value()) << key;
    part[key] = "text";
    EXPECT_FALSE(blockGridFromJson(part).has_value()) << key;
  }
}

TEST(BlockGridJson, RejectsInvalidGrids) {
  const auto with = [](const char* key, const json& value) {
    json changed = blockGridToJson(someGrid());
    changed[key] = value;
    return blockGridFromJson(changed).has_value();
  };
  EXPECT_TRUE(with("columns", 4));
  EXPECT_FALSE(with("columns", 0));
  EXPECT_FALSE(with("columns", -1));
  EXPECT_FALSE(with("columns", 2.5));
  EXPECT_FALSE(with("columns", 4294967297));  // wraps to 1 in 32 bits
  EXPECT_FALSE(with("columns", 40000));       // times 5 rows: too many cells
  EXPECT_TRUE(with("edge", 10));
  EXPECT_FALSE(with("edge", 0));
  EXPECT_FALSE(with("edge", 1e300));
  EXPECT_FALSE(with("edge", 0.2));  // smaller than the height
  EXPECT_FALSE(with("top", -1.0 / 9));
  EXPECT_FALSE(with("origin", {0, 0}));
  EXPECT_FALSE(with("origin", {0, 0, 1e13}));
  EXPECT_TRUE(with("grid_from_world", {0, 1, 0, -1, 0, 0, 0, 0, 1}));
  EXPECT_FALSE(with("grid_from_world", {0, 1, 0, 1, 0, 0, 0, 0, 1}));  // mirrored
  EXPECT_FALSE(with("grid_from_world", {2, 0, 0, 0, 0.5, 0, 0, 0, 1}));
  EXPECT_FALSE(with("grid_from_world", {1, 0, 0, 0, 1, 0, 0, 0}));
  for (const char* text : {"null", "[]", "3", "{}"})
    EXPECT_FALSE(blockGridFromJson(json::parse(text)).has_value()) << text;
}

}  // namespace
}  // namespace tessera
