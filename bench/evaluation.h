// What the programs of this folder report about images that they compare with photos.
#pragma once

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "eval/evaluate.h"

namespace tessera {

// With LPIPS if the environment variable of that name contains the path of its weights.
inline EvaluateOptions optionsOfEnvironment() {
  EvaluateOptions options;
  if (const char* weights = std::getenv("LPIPS")) options.lpipsWeights = weights;
  return options;
}

// Returns psnr, ssim, and lpips, which is null without weights.
inline nlohmann::ordered_json describeQuality(const EvaluationReport& report) {
  nlohmann::ordered_json quality = {{"psnr", report.psnr}, {"ssim", report.ssim}, {"lpips", nullptr}};
  if (report.lpips) quality["lpips"] = *report.lpips;
  return quality;
}

}  // namespace tessera
