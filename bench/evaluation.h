// What the programs of this folder report about images that they compare with photos.
#pragma once

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "eval/evaluate.h"

namespace tessera {

// The path of the weights, which the environment variable LPIPS contains; empty without it.
inline fs::path lpipsWeights() {
  const char* const weights = std::getenv("LPIPS");
  return weights != nullptr ? weights : "";
}

// With LPIPS if there are weights.
inline EvaluateOptions optionsOfEnvironment() {
  EvaluateOptions options;
  options.lpipsWeights = lpipsWeights();
  return options;
}

// Returns psnr, ssim, and lpips, which is null without weights.
inline nlohmann::ordered_json describeQuality(const EvaluationReport& report) {
  nlohmann::ordered_json quality = {{"psnr", report.psnr}, {"ssim", report.ssim}, {"lpips", nullptr}};
  if (report.lpips) quality["lpips"] = *report.lpips;
  return quality;
}

}  // namespace tessera
