#include "pipeline/run_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/folder_size.h"
#include "eval/html.h"
#include "eval/report_style.h"
#include "import/exif.h"
#include "photogrammetry/photo_matches.h"
#include "pipeline/georeference_json.h"
#include "pipeline/left_out_json.h"
#include "pipeline/run_report_figures.h"
#include "pipeline/stage.h"
#include "pipeline/thumbnail.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

// The tags of photos with poses have not been read.
int findOrientation(const ListedPhoto& photo) {
  if (photo.tags.orientation != 1) return photo.tags.orientation;
  try {
    return decodePhotoTags(readPhotoHead(photo.file)).orientation;
  } catch (const Error&) {
    return 1;
  }
}

constexpr char kRunReportStyle[] = R"css(
main { max-width: 1200px; }
ul { margin: .3rem 0; padding-left: 1.2rem; }
li { margin: .3rem 0; overflow-wrap: anywhere; }
.card b { overflow-wrap: anywhere; }
.warnings { background: var(--card); border: 1px solid var(--line); border-left: 4px solid var(--outlier);
  border-radius: 10px; padding: .5rem 1rem .5rem 2rem; }
.photos { display: grid; grid-template-columns: repeat(auto-fill, minmax(125px, 1fr)); gap: .7rem; align-items: end; }
.photos img { width: auto; max-width: 100%; max-height: 180px; }
.photos figcaption { overflow-wrap: anywhere; font-size: .75rem; }
.errors { margin: .6rem 0 1.2rem; }
.errors td:first-child, .wide td:first-child { white-space: nowrap; }
.wide td:last-child { min-width: 16rem; }
.wide td:last-child, .wide th:last-child { text-align: left; white-space: normal; overflow-wrap: anywhere; }
.wide .table { max-height: none; }
summary { cursor: pointer; }
)css";

struct HeldOutResult {
  std::optional<double> psnr, ssim;  // nothing: not a finite number
  std::string exposure;
  size_t views = 0;
};

HeldOutResult readEvaluation(const fs::path& file) {
  const Json json = Json::parse(readTextFile(file), nullptr, false);
  const Error damaged(file.string(), "", "does not describe an evaluation", "run again with --from evaluate");
  const auto number = [&](const char* key) -> std::optional<double> {
    if (!json.contains(key) || (!json[key].is_number() && !json[key].is_null())) throw damaged;
    return json[key].is_null() ? std::nullopt : std::optional(json[key].get<double>());
  };
  if (!json.is_object() || !json.contains("exposure") || !json["exposure"].is_string() || !json.contains("views") ||
      !json["views"].is_array())
    throw damaged;
  return {number("psnr"), number("ssim"), json["exposure"].get<std::string>(), json["views"].size()};
}

std::string formatBytes(double bytes) {
  if (bytes < 1e6) return fmt::format("{:.0f} kB", bytes / 1e3);
  return bytes < 1e9 ? fmt::format("{:.1f} MB", bytes / 1e6) : fmt::format("{:.2f} GB", bytes / 1e9);
}

std::string formatSeconds(double seconds) {
  if (seconds < 59.95) return fmt::format("{:.1f} s", seconds);
  const auto whole = static_cast<int64_t>(seconds + 0.5);
  if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
  return fmt::format("{} h {:02} min", whole / 3600, whole % 3600 / 60);
}

// Numbers that may be 0.01 or 1000.
std::string formatMetres(double metres) {
  return fmt::format("{:.{}f} m", metres, std::abs(metres) < 10 ? 2 : 1);
}

std::string plural(size_t count, const char* noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

std::string summaryCard(const std::string& value, const std::string& label) {
  return fmt::format("<div class=\"card\"><b>{}</b><span class=\"quiet\">{}</span></div>\n", escapedHtml(value),
                     escapedHtml(label));
}

// The names behind a heading that unfolds where they are many.
std::string nameList(const std::string& heading, const std::vector<std::string>& names) {
  constexpr size_t kShown = 8;
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + escapedHtml(name);
  return names.size() <= kShown
             ? fmt::format("{}: <span class=\"quiet\">{}</span>", heading, list)
             : fmt::format("<details><summary>{}</summary><span class=\"quiet\">{}</span></details>", heading, list);
}

using NamesByReason = std::map<std::string, std::vector<std::string>>;

class RunPage {
 public:
  RunPage(const fs::path& out, const RunReportInput& input)
      : out_(out),
        input_(input),
        georeference_(readGeoreference(out / "poses/georeference.json")),
        withoutPose_(readLeftOut(out / "poses/left_out.json")),
        stages_(readStageRecords(out)) {
    if (input.hasEvaluation) evaluation_ = readEvaluation(out / "eval.json");
  }

  std::string html() const {
    const std::string title = escapedHtml(input_.title);
    std::string html =
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n";
    html += fmt::format("<title>{} – run</title>\n<style>{}{}{}</style>\n</head>\n<body>\n<main>\n", title,
                        kReportStyle, kFigureStyle, kRunReportStyle);
    html += fmt::format("<h1>{}</h1>\n", title);
    return html + summary() + warnings() + photos() + georeference() + exposure() + stages() +
           "</main>\n</body>\n</html>\n";
  }

 private:
  std::string summary() const {
    std::string html = "<p class=\"quiet\">From photos to a scene by <code>tessera run</code>";
    std::error_code status;
    if (evaluation_ && fs::exists(out_ / "evaluation.html", status))
      html += " · <a href=\"evaluation.html\">evaluation of the held-out photos</a>";
    html += "</p>\n<div class=\"cards\">\n";
    const size_t used = input_.photos.size();
    html +=
        summaryCard(std::to_string(used),
                    input_.leftOut.empty() ? "photos" : fmt::format("photos, and {} left out", input_.leftOut.size()));
    html += summaryCard(std::to_string(used - std::min(used, withoutPose_.size())), "photos in the scene");
    html += georeference_.reason.empty()
                ? summaryCard("± " + formatMetres(georeference_.middleError), "georeference, standard error")
                : summaryCard("none", "georeference: " + georeference_.reason);
    if (evaluation_) {
      const auto number = [](std::optional<double> value, int digits) {
        return value ? fmt::format("{:.{}f}", *value, digits) : "–";
      };
      html +=
          summaryCard(number(evaluation_->psnr, 2) + " dB", "PSNR of " + plural(evaluation_->views, "held-out photo"));
      html += summaryCard(number(evaluation_->ssim, 4), "SSIM of the same");
    } else {
      html += summaryCard("none", "evaluation: no photo is held out");
    }
    html += summaryCard(input_.method, "method");
    html += summaryCard(formatBytes(static_cast<double>(bytesBelow(out_ / "scene"))), "size of the scene");
    return html + "</div>\n";
  }

  std::string photos() const {
    std::string html;
    const size_t count = std::min(kThumbnails, input_.photos.size());
    for (size_t i = 0; i < count; ++i) {
      // The first, the last, and some between them.
      const size_t index = count > 1 ? i * (input_.photos.size() - 1) / (count - 1) : 0;
      const ListedPhoto& photo = input_.photos[index];
      const auto thumbnail = makeThumbnail(photo.file, findOrientation(photo), kThumbnailSide);
      if (!thumbnail) continue;
      const std::string name = escapedHtml(photo.name);
      html += fmt::format(
          "<figure><img width=\"{}\" height=\"{}\" alt=\"{}\" src=\"data:image/jpeg;base64,{}\"><figcaption>{}"
          "</figcaption></figure>\n",
          thumbnail->width, thumbnail->height, name, base64(thumbnail->jpeg), name);
    }
    return html.empty() ? "" : fmt::format("<h2>Photos</h2>\n<div class=\"photos\">\n{}</div>\n", html);
  }

  std::string warnings() const {
    std::string html;
    if (georeference_.isBent) {
      html += fmt::format(
          "<li>The heights of GPS bend by {:.1f} m ± {:.1f} m from the middle of the photos to the farthest: the poses "
          "form a {}. Photos that look aslant, or lines that cross at another height, prevent it.</li>\n",
          georeference_.bend->metres, georeference_.bend->error, georeference_.bend->metres > 0 ? "dome" : "bowl");
    }
    if (const std::string text = describeDisagreeing(georeference_); !text.empty())
      html += fmt::format("<li>{}.</li>\n", escapedHtml(text));
    if (!georeference_.hasAltitudes)
      html += "<li>GPS states no altitudes: the cameras are taken to be at height 0 of the Earth, on average.</li>\n";
    if (georeference_.ignoresTakeOff)
      html +=
          "<li>Heights above take-off do not fit the poses, as if flights started at other heights: absolute altitudes "
          "are used.</li>\n";
    NamesByReason unusable, withoutPose;
    for (const LeftOutPhoto& photo : input_.leftOut) unusable[photo.reason].push_back(photo.name);
    for (const LeftOutPhoto& photo : withoutPose_) withoutPose[photo.reason].push_back(photo.name);
    if (const auto apart = withoutPose.find(kOfAnotherModel); apart != withoutPose.end()) {
      html += fmt::format(
          "<li>{}</li>\n",
          nameList(fmt::format("The photos form several models, of which the scene shows the largest; {} {} in another",
                               plural(apart->second.size(), "photo"), apart->second.size() == 1 ? "is" : "are"),
                   apart->second));
      withoutPose.erase(apart);
    }
    const auto addGroups = [&](const NamesByReason& groups, const char* what) {
      for (const auto& [reason, names] : groups) {
        html += fmt::format(
            "<li>{}</li>\n",
            nameList(fmt::format("{} {}: {}", plural(names.size(), "photo"), what, escapedHtml(reason)), names));
      }
    };
    addGroups(withoutPose, "not in the scene");
    addGroups(unusable, "not used");
    size_t ofStages = 0;
    for (const StageRecord& stage : stages_) ofStages += stage.warnings.size();
    if (ofStages > 0)
      html += fmt::format("<li>{} of stages: see <a href=\"#stages\">there</a>.</li>\n", plural(ofStages, "warning"));
    return html.empty() ? "<h2>Warnings</h2>\n<p>None: all photos are in the scene.</p>\n"
                        : "<h2>Warnings</h2>\n<ul class=\"warnings\">\n" + html + "</ul>\n";
  }

  std::string georeference() const {
    std::string html = "<h2>Georeference</h2>\n";
    const GeoreferenceFile& fit = georeference_;
    if (!fit.reason.empty()) {
      return html + fmt::format("<p>None: {}. The unit of the scene is not the metre.</p>\n", escapedHtml(fit.reason));
    }
    html += fmt::format(
        "<p>{} of {} GPS fixes agree with the poses, with residuals of {} (root mean square, in three dimensions). "
        "The standard errors hold if the errors of fixes are independent; those of one flight seldom are.</p>\n",
        fit.inliers, fit.fixes, formatMetres(fit.rmsMetres));
    html +=
        "<div class=\"scroll errors\"><table>\n<tr><th></th><th>scale</th><th>rotation</th><th>middle "
        "of "
        "the photos</th><th>a fix, horizontally</th><th>a fix, in height</th></tr>\n";
    html += fmt::format(
        "<tr><td>standard error</td><td>{:.2f} %</td><td>{:.2f}°</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
        100 * fit.scaleError, fit.rotationError, formatMetres(fit.middleError), formatMetres(fit.horizontalDeviation),
        formatMetres(fit.verticalDeviation));
    html += "</table></div>\n";
    std::string flights;
    for (size_t i = 0; i < fit.heightsTooHigh.size(); ++i) {
      if (fit.heightsTooHigh[i] == 0) continue;
      flights += fmt::format("{}flight {}: {:+.1f} m", flights.empty() ? "" : ", ", i + 1, fit.heightsTooHigh[i]);
    }
    if (!flights.empty())
      html += fmt::format("<p>Altitudes that were too high by one height for a flight, corrected: {}.</p>\n", flights);
    if (fit.residuals.empty()) return html;
    for (const SvgFigure& figure : {residualFigure(fit.residuals), planFigure(fit.residuals)})
      html += fmt::format("<figure class=\"figure\">\n{}<figcaption>{}</figcaption>\n</figure>\n", figure.svg,
                          figure.caption);
    return html;
  }

  std::string exposure() const {
    if (!evaluation_) return "";
    return fmt::format("<h2>Exposure</h2>\n<p>Of the renderings that were compared with held-out photos: {}{}.</p>\n",
                       escapedHtml(evaluation_->exposure),
                       evaluation_->exposure == "neutral"
                           ? ", as they were rendered: EXIF states the exposures of too few photos, or does not "
                             "explain how they differ"
                           : "");
  }

  std::string stages() const {
    if (stages_.empty()) return "";
    std::string html =
        "<h2 id=\"stages\">Stages</h2>\n<div class=\"scroll wide\"><table>\n<tr><th>stage</th><th>time</th><th>peak "
        "memory</th>"
        "<th>result</th></tr>\n";
    const auto addRow = [&](const StageRecord& stage) {
      std::string result = escapedHtml(stage.summary);
      for (const std::string& warning : stage.warnings)
        result += fmt::format("<br><span class=\"quiet\">warning: {}</span>", escapedHtml(warning));
      html += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n", escapedHtml(stage.name),
                          formatSeconds(stage.seconds), formatBytes(static_cast<double>(stage.peakBytes)), result);
    };
    StageRecord all{.name = "all"};
    for (const StageRecord& stage : stages_) {
      addRow(stage);
      all.seconds += stage.seconds;
      all.peakBytes = std::max(all.peakBytes, stage.peakBytes);
    }
    addRow(all);
    return html + "</table></div>\n";
  }

  const fs::path& out_;
  const RunReportInput& input_;
  GeoreferenceFile georeference_;
  std::vector<LeftOutPhoto> withoutPose_;
  std::vector<StageRecord> stages_;
  std::optional<HeldOutResult> evaluation_;
};

}  // namespace

std::string runReport(const fs::path& out, const RunReportInput& input) {
  return RunPage(out, input).html();
}

}  // namespace tessera
