#include "partition/block_map.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "partition/block_geography.h"
#include "partition/cameras.h"

namespace tessera {
namespace {

// Dimensions of the map, pixels.
constexpr double kMapSide = 800, kMargin = 40, kHeader = 84, kFooter = 92;
constexpr double kMinWidth = 720;
constexpr double kLargestText = 17, kSmallestText = 7;

constexpr char kStyle[] = R"css(
text { font-family: "Inter", "Segoe UI", "Helvetica Neue", "DejaVu Sans", Arial, sans-serif; fill: #1d2329; }
.quiet { fill: #5f6b76; }
.label { text-anchor: middle; }
.cell { stroke: #ffffff; stroke-width: 1.5; }
.thin { stroke: #b3261e; stroke-width: 1.5; }
.hull { fill: none; stroke: #5f6b76; stroke-width: 1.3; stroke-dasharray: 6 4; }
.camera { fill: #1d2329; fill-opacity: 0.62; }
.other { fill: none; stroke: #1d2329; stroke-opacity: 0.62; stroke-width: 1; }
.line { stroke: #1d2329; stroke-width: 1.5; fill: none; }
)css";

struct Frame {
  Vec2d low, high;        // shown part of the grid's plane
  double scale = 1;       // pixels per world unit
  double left = kMargin;  // of `low`, pixels

  Vec2d at(const Vec2d& xInGrid) const {
    return {left + scale * (xInGrid.x() - low.x()), kHeader + scale * (high.y() - xInGrid.y())};
  }
  double bottom() const { return kHeader + scale * (high.y() - low.y()); }
  double width() const { return std::max(kMinWidth, scale * (high.x() - low.x()) + 2 * kMargin); }
  double height() const { return bottom() + kFooter; }
};

Frame fitFrame(const BlockGrid& grid, const std::vector<Vec2d>& others) {
  Frame frame;
  frame.high = grid.edge / 2 * Vec2d(grid.columns, grid.rows);
  frame.low = -frame.high;
  for (const Vec2d& other : others) {
    frame.low = frame.low.cwiseMin(other);
    frame.high = frame.high.cwiseMax(other);
  }
  const double margin = 0.02 * (frame.high - frame.low).maxCoeff();
  frame.low.array() -= margin;
  frame.high.array() += margin;
  frame.scale = kMapSide / (frame.high - frame.low).maxCoeff();
  frame.left = (frame.width() - frame.scale * (frame.high.x() - frame.low.x())) / 2;
  return frame;
}

// Abbreviates a count: 12 345 678 becomes "12.3 M".
std::string shortCount(int64_t count) {
  if (count < 1000) return fmt::format("{}", count);
  const double value = static_cast<double>(count);
  if (count < 999500) return fmt::format("{:.3g} k", value / 1e3);
  return value < 9.995e8 ? fmt::format("{:.3g} M", value / 1e6) : fmt::format("{:.4g} G", value / 1e9);
}

// The unit in which lengths of the world are shown.
struct Unit {
  double perWorldUnit = 1;
  const char* name = "units";

  std::string say(double worldLength) const { return fmt::format("{:.3g} {}", worldLength * perWorldUnit, name); }
};

Unit worldUnit(const Capture& capture) {
  if (!capture.geo) return {};
  return {std::cbrt(capture.geo->enuFromWorld.topLeftCorner<3, 3>().determinant()), "m"};
}

// Returns a colour from pale to full blue.
std::string shade(double share) {
  static constexpr double kPale[] = {236, 242, 249}, kFull[] = {116, 169, 219};
  const auto mixed = [share](int c) { return static_cast<int>(std::lround(kPale[c] + share * (kFull[c] - kPale[c]))); };
  return fmt::format("#{:02x}{:02x}{:02x}", mixed(0), mixed(1), mixed(2));
}

std::string cellsSvg(const Frame& frame, const Partition& partition) {
  const BlockGrid& grid = partition.grid;
  int64_t maximum = 1;
  for (const CellCoverage& cell : partition.coverage) maximum = std::max(maximum, cell.pixels);
  const double side = frame.scale * grid.edge;
  const double text = std::min(kLargestText, side / 6.5);
  std::string svg, labels;
  for (int cell = 0; cell < grid.cells(); ++cell) {
    const CellCoverage& has = partition.coverage[static_cast<size_t>(cell)];
    const bool thin = partition.isThin(cell);
    const Vec2d middle = frame.at(grid.centre(cell)), corner = middle - Vec2d::Constant(side / 2);
    const std::string name = fmt::format("{}, {}", cell % grid.columns, cell / grid.columns);
    const std::string box =
        fmt::format("x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"", corner.x(), corner.y(), side, side);
    svg += fmt::format("<rect class=\"cell\" {} fill=\"{}\"><title>block ({}): {} photos, {} pixels{}</title></rect>\n",
                       box, shade(static_cast<double>(has.pixels) / static_cast<double>(maximum)), name, has.photos,
                       has.pixels, thin ? ": too few" : "");
    if (thin) svg += fmt::format("<rect class=\"thin\" {} fill=\"url(#hatch)\" pointer-events=\"none\"/>\n", box);
    if (text < kSmallestText) continue;
    labels += fmt::format(
        "<g class=\"label\" pointer-events=\"none\" stroke=\"#fff\" stroke-opacity=\"0.7\" stroke-width=\"3\" "
        "paint-order=\"stroke\" stroke-linejoin=\"round\">"
        "<text x=\"{0:.1f}\" y=\"{1:.1f}\" font-size=\"{2:.1f}\" font-weight=\"650\">{3}</text>"
        "<text x=\"{0:.1f}\" y=\"{4:.1f}\" font-size=\"{5:.1f}\">{6} photos</text>"
        "<text x=\"{0:.1f}\" y=\"{7:.1f}\" font-size=\"{5:.1f}\">{8} px</text></g>\n",
        middle.x(), middle.y() - 0.55 * text, text, name, middle.y() + 0.55 * text, 0.76 * text, has.photos,
        middle.y() + 1.55 * text, shortCount(has.pixels));
  }
  return svg + "<!--marks-->" + labels;
}

std::string polygonSvg(const Frame& frame, const std::vector<Vec2d>& corners) {
  if (corners.empty()) return {};
  std::string points;
  for (const Vec2d& corner : corners) {
    const Vec2d at = frame.at(corner);
    points += fmt::format("{:.1f},{:.1f} ", at.x(), at.y());
  }
  return fmt::format("<polygon class=\"hull\" points=\"{}\"/>\n", points);
}

// Draws the north arrow at `middle`, rotated clockwise from pointing up.
std::string northSvg(const Vec2d& middle, double degrees) {
  return fmt::format(
      "<g class=\"north\" transform=\"translate({:.1f} {:.1f}) rotate({:.1f})\"><path d=\"M0 -18 L7 14 L0 8 Z\" "
      "fill=\"#1d2329\"/><path d=\"M0 -18 L-7 14 L0 8 Z\" fill=\"#fff\" stroke=\"#1d2329\"/>"
      "<text class=\"label\" y=\"-23\" font-size=\"12\" font-weight=\"650\">N</text></g>\n",
      middle.x(), middle.y(), degrees);
}

// Draws a scale bar of the longest length among 1, 2, 5, 10, … that is no wider than `maximum` pixels.
std::string scaleBarSvg(const Frame& frame, const Unit& unit, double x, double y, double maximum) {
  const double longest = maximum / frame.scale * unit.perWorldUnit;
  const double decade = std::pow(10, std::floor(std::log10(longest)));
  const double length = decade * (longest >= 5 * decade ? 5 : longest >= 2 * decade ? 2 : 1);
  const double width = length / unit.perWorldUnit * frame.scale;
  return fmt::format(
      "<path class=\"line\" d=\"M{0:.1f} {1:.1f} v6 h{2:.1f} v-6\"/><text class=\"label\" x=\"{3:.1f}\" y=\"{1:.1f}\" "
      "font-size=\"12\">{4:.6g} {5}</text>\n",
      x, y, width, x + width / 2, length, unit.name);
}

std::string legendSvg(double x, double y, bool hull, bool thin) {
  std::string svg = fmt::format("<g transform=\"translate({:.1f} {:.1f})\" font-size=\"12\">", x, y);
  double at = 0;
  const auto entry = [&](const std::string& mark, const char* text, double width) {
    svg += fmt::format("<g transform=\"translate({:.1f} 0)\">{}<text x=\"26\" y=\"4\">{}</text></g>", at, mark, text);
    at += width;
  };
  entry("<circle class=\"camera\" cx=\"11\" r=\"3\"/>", "training photo", 124);
  entry("<circle class=\"other\" cx=\"11\" r=\"3\"/>", "held-out photo", 124);
  entry("<rect y=\"-7\" width=\"20\" height=\"14\" fill=\"url(#shades)\"/>", "more pixels", 108);
  if (hull) entry("<path class=\"hull\" d=\"M0 0 h21\"/>", "seen on the ground", 160);
  if (thin) entry("<rect class=\"thin\" y=\"-7\" width=\"20\" height=\"14\" fill=\"url(#hatch)\"/>", "too little", 84);
  return svg + "</g>\n";
}

}  // namespace

std::string blockMapSvg(const Capture& capture, const Partition& partition) {
  const BlockGrid& grid = partition.grid;
  const Unit unit = worldUnit(capture);
  std::vector<Vec2d> hull, shown;
  for (const Vec2d& corner : partition.region.hull) {
    hull.push_back(grid.inGrid(partition.ground.inWorld({corner.x(), corner.y(), 0})).head<2>());
  }
  const std::vector<int> together = photosTogether(capture);
  for (const int photo : together) {
    shown.push_back(grid.inGrid(capture.photos[photo].worldFromCamera.translation).head<2>());
  }
  const size_t cameras = shown.size();
  shown.insert(shown.end(), hull.begin(), hull.end());
  const Frame frame = fitFrame(grid, shown);

  std::string marks = polygonSvg(frame, hull);
  const double radius = std::clamp(60 / std::sqrt(static_cast<double>(cameras) + 1), 1.2, 3.2);
  for (size_t i = 0; i < cameras; ++i) {
    const Vec2d at = frame.at(shown[i]);
    marks +=
        fmt::format("<circle class=\"camera\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\"/>\n", at.x(), at.y(), radius);
  }
  for (const Photo& photo : capture.photos) {
    const Vec2d place = grid.inGrid(photo.worldFromCamera.translation).head<2>();
    const bool outside = ((place - frame.low).array() < 0).any() || ((frame.high - place).array() < 0).any();
    if (photo.split == Split::train || outside) continue;
    const Vec2d at = frame.at(place);
    marks +=
        fmt::format("<circle class=\"other\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\"/>\n", at.x(), at.y(), radius);
  }
  std::string cells = cellsSvg(frame, partition);
  const std::string gap = "<!--marks-->";  // dots are drawn over the cells and under their labels
  cells.replace(cells.find(gap), gap.size(), marks);

  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} {1:.0f}\">"
      "\n<style>{2}</style>\n<defs><pattern id=\"hatch\" width=\"8\" height=\"8\" patternUnits=\"userSpaceOnUse\" "
      "patternTransform=\"rotate(45)\"><path d=\"M0 0 V8\" stroke=\"#b3261e\" stroke-opacity=\"0.55\" "
      "stroke-width=\"2.5\"/></pattern><linearGradient id=\"shades\"><stop stop-color=\"{3}\"/><stop offset=\"1\" "
      "stop-color=\"{4}\"/></linearGradient></defs>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n",
      frame.width(), frame.height(), kStyle, shade(0), shade(1));
  svg += fmt::format(
      "<text x=\"{0:.0f}\" y=\"36\" font-size=\"21\" font-weight=\"650\">{1} × {2} blocks of {3}</text>\n"
      "<text class=\"quiet\" x=\"{0:.0f}\" y=\"58\" font-size=\"13\">{4} training photos, a pixel {7} is {5} "
      "wide{6}</text>\n",
      kMargin, grid.columns, grid.rows, unit.say(grid.edge), capture.photosIn(Split::train).size(),
      unit.say(partition.region.groundPixel),
      partition.thin.empty() ? "" : fmt::format("; {} blocks have too little to train from", partition.thin.size()),
      partition.region.looksAtGround ? "on the ground" : "amid them");
  svg += cells;
  if (capture.geo) {
    const Vec3d north = grid.gridFromWorld * capture.geo->enuFromWorld.block<1, 3>(1, 0).transpose();
    svg += northSvg({frame.width() - kMargin - 14, 48}, std::atan2(north.x(), north.y()) * 180 / std::numbers::pi);
  }
  svg += scaleBarSvg(frame, unit, kMargin, frame.bottom() + 24, 220);
  svg += legendSvg(kMargin, frame.bottom() + 62, !hull.empty(), !partition.thin.empty());
  return svg + "</svg>\n";
}

bool writeBlockMap(const fs::path& folder, const Capture& capture, const Partition& partition) {
  writeFileAtomically(folder / "blocks.svg", blockMapSvg(capture, partition));
  const std::optional<std::string> places = blocksAsGeoJson(capture, partition);
  if (places) writeFileAtomically(folder / "blocks.geojson", *places);
  return places.has_value();
}

}  // namespace tessera
