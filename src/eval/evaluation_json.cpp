#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "eval/evaluate.h"
#include "scene/surface_coverage_json.h"

namespace tessera {
namespace {

using nlohmann::ordered_json;

ordered_json number(std::optional<double> value) {
  return value && std::isfinite(*value) ? ordered_json(*value) : ordered_json(nullptr);
}

ordered_json depthObject(const std::optional<DepthError>& depth) {
  if (!depth) return nullptr;
  return {{"absolute_relative", number(depth->absoluteRelative)},
          {"rmse", number(depth->rootMeanSquare)},
          {"median_absolute", number(depth->medianAbsolute)},
          {"within_1.25", number(depth->within125)},
          {"pixels", depth->pixels}};
}

}  // namespace

std::string_view splitName(Split split) {
  switch (split) {
    case Split::train:
      return "train";
    case Split::validation:
      return "validation";
    case Split::test:
      return "test";
  }
  return "";
}

std::optional<Split> splitFromName(std::string_view name) {
  for (const Split split : {Split::train, Split::validation, Split::test}) {
    if (name == splitName(split)) return split;
  }
  return std::nullopt;
}

std::optional<Exposures> exposuresFromName(std::string_view name) {
  if (name == "neutral") return Exposures::neutral;
  if (name == "predicted") return Exposures::predicted;
  if (name == "fitted") return Exposures::fitted;
  return std::nullopt;
}

std::string describeExposures(const EvaluationReport& report) {
  if (report.exposures == Exposures::fitted) return "fitted on the left half, judged on the right";
  std::string how = report.exposures == Exposures::predicted ? "predicted from EXIF" : "neutral";
  // Photos without these tags have the gain 1.
  const auto predicted = std::count_if(report.views.begin(), report.views.end(), [](const ViewResult& view) {
    return view.gain != std::array<double, 3>{1, 1, 1};
  });
  if (report.exposures == Exposures::predicted && predicted < std::ssize(report.views))
    how += fmt::format(" for {} of {} views", predicted, report.views.size());
  return how + (report.rightHalves ? ", judged on the right half" : "");
}

std::string toJson(const EvaluationReport& report) {
  ordered_json views = ordered_json::array();
  for (const ViewResult& view : report.views) {
    ordered_json one = {{"name", view.name},
                        {"psnr", number(view.psnr)},
                        {"ssim", number(view.ssim)},
                        {"lpips", number(view.lpips)},
                        {"depth", depthObject(view.depth)},
                        {"compared", view.compared},
                        {"seconds", number(view.seconds)}};
    if (report.exposures != Exposures::neutral) one["gain"] = view.gain;
    views.push_back(std::move(one));
  }
  ordered_json object = {{"psnr", number(report.psnr)},
                         {"ssim", number(report.ssim)},
                         {"lpips", number(report.lpips)},
                         {"lpips_net", report.lpipsNet.empty() ? ordered_json(nullptr) : ordered_json(report.lpipsNet)},
                         {"depth", depthObject(report.depth)},
                         {"compared", report.compared},
                         {"views", std::move(views)},
                         {"seconds_per_frame", number(report.secondsPerFrame)},
                         {"device", report.device},
                         {"exposure", describeExposures(report)},
                         {"split", splitName(report.split)},
                         {"units",
                          {{"psnr", "dB, mean over views, unrounded rendering against photo bytes / 255, at most 99"},
                           {"ssim", "11x11 Gaussian, valid windows, mean over views"},
                           {"lpips", "version 0.1, inputs in [-1, 1], mean over views"},
                           {"depth", "z-depth in world units; absolute_relative and within_1.25 are ratios"},
                           {"compared", "share of the pixels that were compared, mean over views"},
                           {"seconds", "rendering alone"}}}};
  if (!report.coverage.empty()) object["coverage"] = coverageToJson(report.coverage);
  return object.dump(2, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace tessera
