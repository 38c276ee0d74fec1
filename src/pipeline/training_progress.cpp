#include "pipeline/training_progress.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace tessera {

TrainingProgress readTrainingProgress(const fs::path& model) {
  const fs::path file = model / "manifest.json";
  std::error_code status;
  if (!fs::exists(file, status)) return {};
  const auto manifest = nlohmann::json::parse(readTextFile(file), nullptr, false);
  const auto number = [&](const char* key) {
    constexpr double kMax = 1e15;
    const bool isNumber = manifest.is_object() && manifest.contains(key) && manifest[key].is_number();
    return isNumber ? std::clamp(manifest[key].get<double>(), 0.0, kMax) : 0.0;
  };
  return {static_cast<int64_t>(number("step")), static_cast<int64_t>(number("planned_steps")), number("seconds")};
}

}  // namespace tessera
