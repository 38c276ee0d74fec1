#include "partition/block_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <vector>

#include "base/check.h"
#include "scene/block_grid_json.h"

namespace tessera {
namespace {

constexpr double kSlack = 1e-9;  // relative tolerance for rounding of a whole number of cells

int cellsAlong(double length, double edge) {
  return static_cast<int>(std::clamp(std::ceil(length / edge * (1 - kSlack)), 1.0, static_cast<double>(kMaxAlong)));
}

double cellsFor(const Rectangle& region, double edge) {
  return static_cast<double>(cellsAlong(region.width, edge)) * cellsAlong(region.depth, edge);
}

// Returns the smallest edge that divides the region into at most `maximum` cells. It divides one of the sides evenly.
double smallestEdge(const Rectangle& region, int maximum) {
  double smallest = std::max(region.width, region.depth);
  for (const double side : {region.width, region.depth}) {
    // Cells shrink as their number along this side grows: the search ends at the first count that is too high.
    for (int count = 1; count <= maximum && cellsFor(region, side / count) <= maximum; ++count) {
      smallest = std::min(smallest, side / count);
    }
  }
  return smallest;
}

// Compares the texel of the finest plane with a photo's pixel on the ground.
std::string describeFineness(double edge, const Region& region, const BlockLimits& limits) {
  const double texel = edge / limits.texelsPerEdge;
  return fmt::format("a texel is {:.3g} wide, a photo's pixel on the ground {:.3g}", texel, region.groundPixel);
}

}  // namespace

std::optional<BlockCount> parseBlockCount(std::string_view text) {
  if (text == "auto") return BlockCount{};
  const size_t times = text.find('x');
  if (times == std::string_view::npos) return std::nullopt;
  BlockCount count{false, 0, 0};
  const auto read = [](std::string_view digits, int& value) {
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return error == std::errc() && end == digits.data() + digits.size() && value >= 1 && value <= kMaxAlong;
  };
  if (!read(text.substr(0, times), count.columns) || !read(text.substr(times + 1), count.rows)) return std::nullopt;
  if (count.columns > kMaxBlocks / count.rows) return std::nullopt;
  return count;
}

BlockLayout layOutBlocks(const Ground& ground, const Region& region, const Heights& heights, const BlockCount& count,
                         const BlockLimits& limits) {
  const Rectangle& area = region.rectangle;
  const double high = heights.top - heights.bottom;
  CHECK(area.width > 0);
  CHECK(area.depth > 0);
  CHECK(high > 0);
  CHECK(limits.texelsPerEdge > 0);
  CHECK(limits.bytesPerBlock > 0);
  BlockLayout layout;
  BlockGrid& grid = layout.grid;
  if (count.automatic) {
    const double affordable = std::floor(limits.memoryBudget / limits.bytesPerBlock);
    const int maximum = static_cast<int>(std::clamp(affordable, 1.0, static_cast<double>(kMaxBlocks)));
    const double fineEdge = limits.groundPixelsPerTexel * region.groundPixel * limits.texelsPerEdge;
    double edge = fineEdge;
    layout.decidedBy = DecidedBy::detail;
    if (cellsFor(area, fineEdge) > maximum) {
      edge = smallestEdge(area, maximum);
      layout.decidedBy = DecidedBy::memory;
    }
    if (high > edge && cellsFor(area, high) < cellsFor(area, edge)) {
      edge = high;
      layout.decidedBy = DecidedBy::height;
    }
    grid.columns = cellsAlong(area.width, edge);
    grid.rows = cellsAlong(area.depth, edge);
    if (layout.decidedBy == DecidedBy::memory) {
      layout.how = fmt::format("as many as the memory budget of {:.3g} MB holds at {:.3g} MB each",
                               limits.memoryBudget / 1e6, limits.bytesPerBlock / 1e6);
      if (affordable < 1) layout.how += " (not even one: it will need more than the budget)";
    } else if (layout.decidedBy == DecidedBy::detail) {
      layout.how = "as many as make the texels as fine as the photos";
    } else {
      layout.how = "as many as allow cells that are as wide as the scene is high";
    }
  } else {
    grid.columns = count.columns;
    grid.rows = count.rows;
    layout.how = "as requested";
  }
  grid.edge = std::max(area.width / grid.columns, area.depth / grid.rows);
  if (high > grid.edge) {
    layout.how += fmt::format(", enlarged from {:.4g} to {:.4g} wide, as the scene is that high", grid.edge, high);
    grid.edge = high;
  }
  layout.how = fmt::format("{} x {} blocks, {}; {}", grid.columns, grid.rows, layout.how,
                           describeFineness(grid.edge, region, limits));

  Mat3d turn = Mat3d::Identity();
  turn.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(-area.angle).toRotationMatrix();
  grid.gridFromWorld = turn * ground.groundFromWorld;
  grid.originInWorld = ground.inWorld({area.centre.x(), area.centre.y(), (heights.bottom + heights.top) / 2});
  grid.bottom = -high / 2;
  grid.top = high / 2;
  return layout;
}

}  // namespace tessera
