#include "pipeline/run_report_figures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/order_statistics.h"
#include "eval/html.h"

namespace tessera {

const char kFigureStyle[] = R"css(
:root { --outlier: #c4472b; --band: #2763c41f; }
@media (prefers-color-scheme: dark) { :root { --outlier: #ff8a6b; --band: #7fb0ff2e; } }
.figure { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: .8rem 1rem; margin: .8rem
  0 1rem; }
.figure { overflow-x: auto; }
.figure svg { display: block; width: 100%; min-width: 40rem; height: auto; }
.figure text { fill: var(--quiet); font-size: 13px; }
.figure .grid { stroke: var(--line); fill: none; }
.figure .zero { stroke: var(--quiet); fill: none; }
.figure .band { fill: var(--band); stroke: none; }
.figure .edge { stroke: var(--quiet); stroke-dasharray: 5 4; fill: none; }
.figure .marks path { stroke: var(--accent); fill: none; }
.figure .marks path.outlier { stroke: var(--outlier); }
.figure .thin path.outlier { stroke-width: 1.5; }
.figure .marks path:hover { stroke: var(--text); }
.figure marker path, .figure marker circle { fill: var(--accent); stroke: none; }
.figure marker.outlier path, .figure marker.outlier circle { fill: var(--outlier); }
.figure .arrows path { marker-start: url(#camera); marker-end: url(#tip); stroke-width: 1.3; }
.figure .arrows path.outlier { marker-start: url(#outlier-camera); marker-end: url(#outlier-tip); }
.key { display: inline-block; width: .8em; height: .8em; border-radius: 2px; background: var(--accent); }
.key.outlier { background: var(--outlier); }
)css";

namespace {

using Residual = GeoreferenceFile::Residual;

constexpr double kWidth = 1000, kLeft = 56, kRight = 8;  // of a figure, in its units

// Returns 1, 2 or 5 times a power of ten, the smallest one that is not below `value`.
double roundUp(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double digit : {1.0, 2.0, 5.0})
    if (digit * power >= value * (1 - 1e-9)) return digit * power;
  return 10 * power;
}

// The same, the largest one that is not above `value`.
double roundDown(double value) {
  const double power = std::pow(10, std::floor(std::log10(value)));
  for (const double digit : {5.0, 2.0})
    if (digit * power <= value) return digit * power;
  return power;
}

// A number without trailing zeros, as labels of an axis need it.
std::string axisLabel(double value) {
  return fmt::format("{:.6g}", value);
}

double horizontalResidual(const Residual& residual) {
  return residual.metres.head<2>().norm();
}

// The root mean square of the horizontal residual.
double predictedHorizontal(const Residual& residual) {
  return residual.predicted.head<2>().norm();
}

// By flight, then by name.
std::vector<Residual> inOrderOfPhotos(std::vector<Residual> residuals) {
  std::stable_sort(residuals.begin(), residuals.end(), [](const Residual& a, const Residual& b) {
    return a.flight != b.flight ? a.flight < b.flight : naturalLess(a.photo, b.photo);
  });
  return residuals;
}

// The name as a tooltip shows it. Long names, of which thousands would make the page large, lose their beginning.
std::string tooltip(const Residual& residual) {
  constexpr size_t kLongest = 60;
  std::string name = residual.photo;
  if (name.size() > kLongest) {
    size_t begin = name.size() - kLongest;
    while (begin < name.size() && (static_cast<unsigned char>(name[begin]) & 0xc0) == 0x80) ++begin;
    name = "…" + name.substr(begin);
  }
  return fmt::format("<title>{}: {:.2f} m horizontally, {:+.2f} m in height{}</title>", escapedHtml(name),
                     horizontalResidual(residual), residual.metres.z(), residual.isInlier ? "" : ", outlier");
}

const char* markClass(const Residual& residual) {
  return residual.isInlier ? "" : " class=\"outlier\"";
}

std::string outlierKey(const std::vector<Residual>& residuals) {
  const bool hasOutliers =
      std::any_of(residuals.begin(), residuals.end(), [](const Residual& residual) { return !residual.isInlier; });
  return hasOutliers ? " <span class=\"key outlier\"></span> Outliers, which do not count." : "";
}

// Where the bars of photos stand: next to each other, with a gap between flights.
class PhotoAxis {
 public:
  // `residuals` in order of photos.
  explicit PhotoAxis(const std::vector<Residual>& residuals) {
    constexpr double kGapShare = 0.015, kGapsShare = 0.3;  // of the width: of a gap, at most of all together
    for (size_t i = 0; i < residuals.size(); ++i) {
      if (i == 0 || residuals[i].flight != residuals[i - 1].flight)
        flights_.push_back({residuals[i].flight, i, residuals.size()});
      if (flights_.size() > 1 && flights_.back().begin == i) flights_[flights_.size() - 2].end = i;
      flightOfPhoto_.push_back(flights_.size() - 1);
    }
    const double width = kWidth - kLeft - kRight;
    const auto gaps = static_cast<double>(flights_.size() - 1);
    gap_ = gaps > 0 ? std::min(kGapShare, kGapsShare / gaps) * width : 0;
    slot_ = (width - gaps * gap_) / static_cast<double>(residuals.size());
  }

  struct Flight {
    int number = 0;
    size_t begin = 0, end = 0;  // photos
  };
  const std::vector<Flight>& flights() const { return flights_; }
  double left(size_t photo) const {
    return kLeft + static_cast<double>(photo) * slot_ + static_cast<double>(flightOfPhoto_[photo]) * gap_;
  }
  double middle(size_t photo) const { return left(photo) + slot_ / 2; }
  double right(size_t photo) const { return left(photo) + slot_; }
  double barWidth() const { return std::min(14.0, 0.8 * slot_); }

 private:
  std::vector<Flight> flights_;
  std::vector<size_t> flightOfPhoto_;
  double gap_ = 0, slot_ = 0;
};

// One of the two diagrams: heights above a line of zero.
struct Panel {
  double top = 0, bottom = 0;      // in the figure
  double highest = 0, lowest = 0;  // metres at these
  double y(double metres) const {  // what lies outside ends at the edge
    const double clamped = std::clamp(metres, lowest, highest);
    return bottom - (clamped - lowest) / (highest - lowest) * (bottom - top);
  }
  // Of a bar that can be seen even if the residual is 0.
  double barEnd(double metres) const {
    const double zero = y(0), end = y(metres);
    return std::abs(end - zero) >= 1 ? end : end > zero ? zero + 1 : zero - 1;
  }
};

std::string axis(const Panel& panel, const std::string& title) {
  std::string svg = fmt::format("<text x=\"{}\" y=\"{:.1f}\">{}</text>\n", kLeft, panel.top - 8, title);
  const double step = roundUp((panel.highest - panel.lowest) / 5);
  for (double tick = std::ceil(panel.lowest / step) * step; tick <= panel.highest * (1 + 1e-9); tick += step) {
    const double value = std::abs(tick) < 1e-9 * step ? 0 : tick, y = panel.y(value);
    svg += fmt::format(
        "<path class=\"{}\" d=\"M{} {:.1f}H{}\"/><text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n",
        value == 0 ? "zero" : "grid", kLeft, y, kWidth - kRight, kLeft - 6, y + 4, axisLabel(value));
  }
  return svg;
}

// Draws what is predicted from `low` to `high` times the value of a photo; photos of one value share a rectangle.
template <typename Predicted>
void addBand(const std::vector<Residual>& residuals, const PhotoAxis& photos, const Panel& panel, bool isTwoSided,
             const Predicted& predicted, std::string& band, std::string& edge) {
  for (size_t begin = 0, end = 0; begin < residuals.size(); begin = end) {
    const double value = predicted(residuals[begin]);
    for (end = begin + 1; end < residuals.size(); ++end)
      if (residuals[end].flight != residuals[begin].flight || predicted(residuals[end]) != value) break;
    const double left = photos.left(begin), right = photos.right(end - 1);
    const double high = panel.y(value), low = panel.y(isTwoSided ? -value : 0);
    band += fmt::format("M{:.1f} {:.1f}H{:.1f}V{:.1f}H{:.1f}Z", left, high, right, low, left);
    edge += fmt::format("M{:.1f} {:.1f}H{:.1f}", left, high, right);
    if (isTwoSided) edge += fmt::format("M{:.1f} {:.1f}H{:.1f}", left, low, right);
  }
}

}  // namespace

SvgFigure residualFigure(const std::vector<Residual>& unordered) {
  const std::vector<Residual> residuals = inOrderOfPhotos(unordered);
  const PhotoAxis photos(residuals);
  // Outliers may be off by kilometres.
  double across = 0.01, up = 0.01;
  bool isCut = false;
  for (const Residual& residual : residuals) {
    across = std::max({across, predictedHorizontal(residual), residual.isInlier ? horizontalResidual(residual) : 0});
    up = std::max({up, residual.predicted.z(), residual.isInlier ? std::abs(residual.metres.z()) : 0});
  }
  across *= 1.08;
  up *= 1.08;
  for (const Residual& residual : residuals)
    isCut = isCut || horizontalResidual(residual) > across || std::abs(residual.metres.z()) > up;

  const double top = photos.flights().size() > 1 ? 48 : 24;
  const Panel horizontal{top, top + 180, across, 0}, vertical{top + 220, top + 400, up, -up};
  std::string band, edge, flights, marks;
  addBand(residuals, photos, horizontal, false, predictedHorizontal, band, edge);
  addBand(
      residuals, photos, vertical, true, [](const Residual& residual) { return residual.predicted.z(); }, band, edge);
  for (const PhotoAxis::Flight& flight : photos.flights()) {
    const double left = photos.left(flight.begin), right = photos.right(flight.end - 1);
    const std::string name = fmt::format("{}{}", right - left > 70 ? "flight " : "", flight.number + 1);
    if (photos.flights().size() < 2 || right - left < 9.0 * static_cast<double>(name.size())) continue;
    flights += fmt::format("<text x=\"{:.1f}\" y=\"16\" text-anchor=\"middle\">{}</text>\n", (left + right) / 2, name);
  }
  for (size_t i = 0; i < residuals.size(); ++i) {
    marks +=
        fmt::format("<path{} d=\"M{:.1f} {:.1f}V{:.1f}M{:.1f} {:.1f}V{:.1f}\">{}</path>\n", markClass(residuals[i]),
                    photos.middle(i), horizontal.y(0), horizontal.barEnd(horizontalResidual(residuals[i])),
                    photos.middle(i), vertical.y(0), vertical.barEnd(residuals[i].metres.z()), tooltip(residuals[i]));
  }
  SvgFigure figure;
  figure.svg = fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"Residuals of GPS by photo\">\n{}{}{}",
                           kWidth, top + 408, flights, axis(horizontal, "horizontal residual, metres"),
                           axis(vertical, "vertical residual, metres; above zero: GPS is above the pose"));
  figure.svg += fmt::format("<path class=\"band\" d=\"{}\"/>\n<g class=\"marks{}\" stroke-width=\"{:.2f}\">\n{}</g>\n",
                            band, photos.barWidth() < 1.5 ? " thin" : "", photos.barWidth(), marks);
  figure.svg += fmt::format("<path class=\"edge\" d=\"{}\"/>\n</svg>\n", edge);
  figure.caption = fmt::format(
      "Residuals of the GPS fixes from the poses, one bar for each photo, in order of the names{}. Band: the standard "
      "deviation that is predicted for a fix.{}{}",
      photos.flights().size() > 1 ? ", flight by flight" : "", outlierKey(residuals),
      isCut ? " Bars that do not fit end at the edge." : "");
  return figure;
}

SvgFigure planFigure(const std::vector<Residual>& residuals) {
  Eigen::AlignedBox2d box;
  std::vector<double> lengths;  // of inliers
  for (const Residual& residual : residuals) {
    box.extend(residual.position.head<2>());
    if (residual.isInlier) lengths.push_back(horizontalResidual(residual));
  }
  constexpr double kTop = 24, kBottom = 26, kLowest = 280, kHighest = 700;     // heights of the figure
  constexpr double kMargin = 0.1, kTypicalArrow = 0.05, kLongestArrow = 0.09;  // of the longer side
  const double side = std::max(box.sizes().maxCoeff(), 1.0);
  const Vec2d size = (box.sizes().array() + 2 * kMargin * side).matrix();
  const double width = kWidth - kLeft - kRight;
  const double height = std::clamp(width * size.y() / size.x(), kLowest, kHighest);
  const double scale = std::min(width / size.x(), height / size.y());  // units of the figure by metre
  const double typical = lengths.empty() ? 0 : upperMedian(lengths);
  // Arrows should not cover those of the neighbours.
  const double target = std::min(kTypicalArrow, 0.4 / std::sqrt(static_cast<double>(residuals.size()))) * side;
  const double factor = typical > 0 ? std::max(1.0, roundDown(target / typical)) : 1;
  const Vec2d middle = box.center();
  const auto x = [&](double east) { return kLeft + width / 2 + (east - middle.x()) * scale; };
  const auto y = [&](double north) { return kTop + height / 2 - (north - middle.y()) * scale; };
  std::string grid, marks;
  const double step = roundUp(std::max(width, height) / scale / 8);
  const auto addLines = [&](double low, double high, auto&& line) {
    for (double at = std::ceil(low / step) * step; at <= high; at += step)
      grid += line(std::abs(at) < 1e-9 * step ? 0 : at);
  };
  addLines(middle.x() - width / 2 / scale, middle.x() + width / 2 / scale, [&](double east) {
    return fmt::format(
        "<path class=\"grid\" d=\"M{:.1f} {}V{:.1f}\"/><text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">"
        "{}</text>\n",
        x(east), kTop, kTop + height, x(east), kTop + height + 17, axisLabel(east));
  });
  addLines(middle.y() - height / 2 / scale, middle.y() + height / 2 / scale, [&](double north) {
    return fmt::format(
        "<path class=\"grid\" d=\"M{} {:.1f}H{}\"/><text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", kLeft,
        y(north), kWidth - kRight, kLeft - 6, y(north) + 4, axisLabel(north));
  });
  bool isShortened = false;
  for (const Residual& residual : residuals) {
    Vec2d arrow = factor * residual.metres.head<2>();
    if (const double length = arrow.norm(); length > kLongestArrow * side) {
      arrow *= kLongestArrow * side / length;
      isShortened = true;
    }
    const Vec2d begin = residual.position.head<2>(), end = begin + arrow;
    marks += fmt::format("<path{} d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\">{}</path>\n", markClass(residual), x(begin.x()),
                         y(begin.y()), x(end.x()), y(end.y()), tooltip(residual));
  }
  const auto markers = [](const char* prefix, const char* name) {
    return fmt::format(
        "<marker id=\"{0}camera\"{1} markerUnits=\"userSpaceOnUse\" markerWidth=\"6\" markerHeight=\"6\" "
        "refX=\"3\" refY=\"3\"><circle cx=\"3\" cy=\"3\" r=\"2.6\"/></marker>\n"
        "<marker id=\"{0}tip\"{1} markerUnits=\"userSpaceOnUse\" markerWidth=\"8\" markerHeight=\"6\" "
        "refX=\"7\" refY=\"3\" orient=\"auto\"><path d=\"M0 0L7 3L0 6Z\"/></marker>\n",
        prefix, name);
  };
  SvgFigure figure;
  figure.svg = fmt::format(
      "<svg viewBox=\"0 0 {} {:.0f}\" role=\"img\" aria-label=\"Cameras from above\">\n<defs>\n{}{}</defs>\n"
      "<text x=\"{}\" y=\"14\">metres north</text><text x=\"{}\" y=\"14\" text-anchor=\"end\">north is up; metres east "
      "along "
      "the bottom</text>\n{}<g class=\"marks arrows\">\n{}</g>\n</svg>\n",
      kWidth, kTop + height + kBottom, markers("", ""), markers("outlier-", " class=\"outlier\""), kLeft,
      kWidth - kRight, grid, marks);
  figure.caption = fmt::format("The cameras from above. Arrows point from the pose to the GPS fix, {}.{}{}",
                               factor > 1 ? fmt::format("exaggerated {} times", axisLabel(factor)) : "true to scale",
                               outlierKey(residuals), isShortened ? " Long arrows are shortened." : "");
  return figure;
}

}  // namespace tessera
