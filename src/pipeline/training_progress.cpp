#include "pipeline/training_progress.h"

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/order_statistics.h"

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

double readRaysPerSecond(const fs::path& model) {
  constexpr int64_t kTail = 1 << 14;
  constexpr size_t kLastLines = 5;
  std::ifstream file(model / "metrics.jsonl", std::ios::binary | std::ios::ate);
  if (!file) return 0;
  file.seekg(std::max<int64_t>(0, static_cast<int64_t>(file.tellg()) - kTail));
  std::vector<double> rates;
  for (std::string line; std::getline(file, line);) {  // the first one may lack its beginning
    const auto metrics = nlohmann::json::parse(line, nullptr, false);
    if (!metrics.is_object() || !metrics.contains("rays_per_second")) continue;
    const auto& rate = metrics["rays_per_second"];
    if (rate.is_number() && rate.get<double>() > 0) rates.push_back(rate.get<double>());
  }
  if (rates.size() > kLastLines) rates.erase(rates.begin(), rates.end() - kLastLines);
  return rates.empty() ? 0 : upperMedian(rates);
}

}  // namespace tessera
