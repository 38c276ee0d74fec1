#include "eval/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/image_io.h"
#include "base/order_statistics.h"
#include "eval/heat_map.h"
#include "eval/html.h"
#include "eval/psnr.h"
#include "eval/report_style.h"

namespace tessera {
namespace {

constexpr int kJpegQuality = 85;

int longestSideFor(size_t views) {
  return views <= 24 ? 720 : views <= 100 ? 440 : views <= 400 ? 280 : 180;
}

std::string formatted(std::optional<double> value, int digits) {
  return value && std::isfinite(*value) ? fmt::format("{:.{}f}", *value, digits) : "–";
}

std::string formattedSeconds(double seconds) {
  return seconds < 1 ? fmt::format("{:.1f} ms", seconds * 1000) : fmt::format("{:.2f} s", seconds);
}

// Returns the rendered z-depth divided by opacity; NaN where almost nothing, or only the background, was rendered.
ImageF normalisedDepth(const RenderedView& view) {
  ImageF depth = view.depth;
  for (size_t i = 0; i < depth.pixels.size(); ++i) {
    const float opacity = view.opacity.pixels[i];
    depth.pixels[i] = opacity > 0.05f && depth.pixels[i] > 0 ? depth.pixels[i] / opacity : std::nanf("");
  }
  return depth;
}

// Returns the second and the 98th percentile, so that a few outliers do not dominate the range of colours.
std::pair<float, float> depthRange(const ImageF& depth) {
  std::vector<float> known;
  for (const float value : depth.pixels) {
    if (std::isfinite(value) && value > 0) known.push_back(value);
  }
  if (known.empty()) return {0.0f, 1.0f};
  const float low = percentile(known, 0.02), high = percentile(known, 0.98);
  return {low, high};
}

// Returns the indices of the views, worst PSNR first; those without a PSNR are last.
std::vector<size_t> worstFirst(const std::vector<ViewResult>& views) {
  std::vector<size_t> order(views.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const auto key = [&](size_t i) { return std::isfinite(views[i].psnr) ? views[i].psnr : kMaximumPsnr + 1; };
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return key(a) < key(b); });
  return order;
}

std::string card(const std::string& value, const std::string& label) {
  return fmt::format("<div class=\"card\"><b>{}</b><span class=\"quiet\">{}</span></div>\n", escapedHtml(value),
                     escapedHtml(label));
}

std::string summary(const EvaluationReport& report) {
  std::string html = "<div class=\"cards\">\n";
  html += card(formatted(report.psnr, 2) + " dB", "PSNR, mean over views");
  html += card(formatted(report.ssim, 4), "SSIM");
  if (report.lpips) html += card(formatted(report.lpips, 4), "LPIPS (" + report.lpipsNet + ")");
  if (report.depth) {
    html += card(fmt::format("{:.2f} %", 100 * report.depth->absoluteRelative), "mean relative depth error");
    html += card(fmt::format("{:.1f} %", 100 * report.depth->within125), "of depths within a factor of 1.25");
  }
  if (report.compared < 1) html += card(fmt::format("{:.1f} %", 100 * report.compared), "of the pixels are compared");
  if (!report.coverage.empty()) {
    html += card(fmt::format("{:.3f} %", 100 * sumCoverage(report.coverage).share()), "of surface pixels with a hole");
  }
  html += card(formattedSeconds(report.secondsPerFrame), "per frame");
  html += "</div>\n";
  html += fmt::format(
      "<p class=\"quiet\" style=\"margin-top:.9rem\">Exposure: {}. PSNR compares the unrounded rendering "
      "with the photo's bytes; SSIM uses 11×11 Gaussian windows that lie wholly inside the image.</p>\n",
      escapedHtml(describeExposures(report)));
  return html;
}

// Returns a bar chart of the PSNR of each view, in the order of the capture.
std::string bars(const EvaluationReport& report) {
  double minimum = kMaximumPsnr, maximum = 0;
  for (const ViewResult& view : report.views) {
    if (!std::isfinite(view.psnr)) continue;
    minimum = std::min(minimum, view.psnr);
    maximum = std::max(maximum, view.psnr);
  }
  if (report.views.size() < 2 || maximum <= 0) return {};
  const double bottom = std::max(0.0, std::floor(minimum - 0.25 * (maximum - minimum) - 1));
  std::string html = fmt::format(
      "<h2>PSNR by view, in capture order <span class=\"quiet\">({:.0f} to {:.1f} dB)</span></h2>\n"
      "<div class=\"bars\"><svg viewBox=\"0 0 {} 100\" preserveAspectRatio=\"none\" role=\"img\" "
      "aria-label=\"PSNR by view\">\n",
      bottom, maximum, report.views.size() * 10);
  for (size_t i = 0; i < report.views.size(); ++i) {
    const ViewResult& view = report.views[i];
    if (!std::isfinite(view.psnr)) continue;
    const double height = std::max(1.0, 100 * (view.psnr - bottom) / (maximum - bottom));
    html += fmt::format(
        "<a href=\"#view-{}\"><title>{}: {:.2f} dB</title><rect x=\"{}\" y=\"{:.1f}\" width=\"8\" "
        "height=\"{:.1f}\"/></a>\n",
        i, escapedHtml(view.name), view.psnr, i * 10 + 1, 100 - height, height);
  }
  return html + "</svg></div>\n";
}

std::string table(const EvaluationReport& report, const std::vector<size_t>& order) {
  std::string html =
      "<h2>Views, worst first</h2>\n<div class=\"scroll table\"><table>\n<tr><th>view</th><th>PSNR, dB</th>"
      "<th>SSIM</th>";
  if (report.lpips) html += "<th>LPIPS</th>";
  if (report.depth) html += "<th>depth error</th><th>within 1.25</th>";
  if (report.exposures != Exposures::neutral) html += "<th>gain r, g, b</th>";
  html += "<th>time</th></tr>\n";
  for (const size_t i : order) {
    const ViewResult& view = report.views[i];
    html += fmt::format("<tr><td><a href=\"#view-{}\">{}</a></td><td>{}</td><td>{}</td>", i, escapedHtml(view.name),
                        formatted(view.psnr, 2), formatted(view.ssim, 4));
    if (report.lpips) html += fmt::format("<td>{}</td>", formatted(view.lpips, 4));
    if (report.depth) {
      html += view.depth ? fmt::format("<td>{:.2f} %</td><td>{:.1f} %</td>", 100 * view.depth->absoluteRelative,
                                       100 * view.depth->within125)
                         : "<td>–</td><td>–</td>";
    }
    if (report.exposures != Exposures::neutral) {
      html += fmt::format("<td>{:.3f}, {:.3f}, {:.3f}</td>", view.gain[0], view.gain[1], view.gain[2]);
    }
    html += fmt::format("<td>{}</td></tr>\n", formattedSeconds(view.seconds));
  }
  return html + "</table></div>\n";
}

std::string coverageTable(const std::vector<SurfaceCoverage>& parts) {
  if (parts.empty()) return {};
  std::string html =
      "<h2>Coverage</h2>\n<p class=\"quiet\">Pixels of the training photos that show a surface of a part, checked in "
      "training; in a hole, the part is less than half opaque.</p>\n<div class=\"scroll table\"><table>\n"
      "<tr><th>part</th><th>pixels</th><th>holes</th><th>share</th></tr>\n";
  for (const SurfaceCoverage& part : parts) {
    html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{:.3f} %</td></tr>\n", escapedHtml(part.part),
                        part.pixels, part.holes, 100 * part.share());
  }
  return html + "</table></div>\n";
}

}  // namespace

ReportBuilder::ReportBuilder(std::string title, size_t expectedViews)
    : title_(std::move(title)), longestSide_(longestSideFor(expectedViews)) {}

ReportBuilder::Figure ReportBuilder::figure(std::string caption, const ImageU8& image, int orientation) const {
  const double scale = std::min(1.0, static_cast<double>(longestSide_) / std::max(image.width, image.height));
  const auto scaled = [scale](int side) { return std::max(1, static_cast<int>(std::lround(side * scale))); };
  const ImageU8 upright = turnUpright(downscaleByArea(image, scaled(image.width), scaled(image.height)), orientation);
  return {std::move(caption), encodeJpeg(upright, kJpegQuality), upright.width, upright.height};
}

void ReportBuilder::add(const ViewResult& result, const ViewPictures& pictures) {
  std::vector<Figure>& figures = figures_[result.name];
  figures.clear();
  const auto add = [&](std::string caption, const ImageU8& image) {
    figures.push_back(figure(std::move(caption), image, pictures.orientation));
  };
  add("photo", toBytes(pictures.photo));
  add("rendering", toBytes(pictures.rendered));
  ImageF error = absoluteDifference(pictures.photo, pictures.rendered);
  if (pictures.mask) {
    for (size_t i = 0; i < error.pixels.size(); ++i) {
      if (pictures.mask->pixels[i] == 0) error.pixels[i] = std::nanf("");
    }
  }
  add(fmt::format("error, black 0 to white {}{}", kBrightestError, pictures.mask ? ", grey: not compared" : ""),
      heatMap(error, 0, kBrightestError, ColourMap::inferno));
  const ImageF depth = normalisedDepth(pictures.view);
  const auto [nearest, farthest] = depthRange(pictures.measuredDepth ? *pictures.measuredDepth : depth);
  const std::string range = fmt::format("{:.3g} (blue) to {:.3g} (yellow)", nearest, farthest);
  add("depth, " + range, heatMap(depth, nearest, farthest, ColourMap::viridis));
  if (pictures.measuredDepth) {
    ImageF measured = *pictures.measuredDepth;
    for (float& value : measured.pixels) {
      if (!(value > 0)) value = std::nanf("");
    }
    add("depth, measured", heatMap(measured, nearest, farthest, ColourMap::viridis));
  }
}

std::string ReportBuilder::html(const EvaluationReport& report) const {
  const std::vector<size_t> order = worstFirst(report.views);
  const std::string title = escapedHtml(title_);
  std::string html =
      "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
  html +=
      fmt::format("<title>{} – evaluation</title>\n<style>{}</style>\n</head>\n<body>\n<main>\n", title, kReportStyle);
  html += fmt::format("<h1>{}</h1>\n<p class=\"quiet\">{} views of the {} split · {}</p>\n", title, report.views.size(),
                      splitName(report.split), escapedHtml(report.device));
  html += summary(report);
  html += bars(report);
  html += table(report, order);
  html += coverageTable(report.coverage);
  html +=
      "<h2>Images</h2>\n<p class=\"quiet\" style=\"margin-bottom:.8rem\">Click an image to enlarge it and again to "
      "return.</p>\n";
  for (const size_t i : order) {
    const ViewResult& view = report.views[i];
    html += fmt::format(
        "<section class=\"view\" id=\"view-{}\">\n<header><h3>{}</h3><span>{} dB</span>"
        "<span class=\"quiet\">SSIM {}</span>",
        i, escapedHtml(view.name), formatted(view.psnr, 2), formatted(view.ssim, 4));
    if (view.lpips) html += fmt::format("<span class=\"quiet\">LPIPS {}</span>", formatted(view.lpips, 4));
    html += "</header>\n<div class=\"figures\">\n";
    const auto entry = figures_.find(view.name);
    if (entry != figures_.end()) {
      for (const Figure& one : entry->second) {
        html += fmt::format(
            "<figure><label><input type=\"checkbox\" autocomplete=\"off\"><img width=\"{}\" height=\"{}\" alt=\"{}\" "
            "src=\"data:image/jpeg;base64,{}\"></label><figcaption>{}</figcaption></figure>\n",
            one.width, one.height, escapedHtml(one.caption), base64(one.jpeg), escapedHtml(one.caption));
      }
    }
    html += "</div>\n</section>\n";
  }
  return html + "</main>\n</body>\n</html>\n";
}

void ReportBuilder::write(const fs::path& path, const EvaluationReport& report) const {
  writeFileAtomically(path, html(report));
}

}  // namespace tessera
