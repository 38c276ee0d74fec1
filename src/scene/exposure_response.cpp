#include "scene/exposure_response.h"

#include <cmath>
#include <vector>

#include "base/check.h"

namespace tessera {

std::array<double, 3> ExposureResponse::gain(std::optional<double> exposure) const {
  std::array<double, 3> gains = {1, 1, 1};
  if (!exposure) return gains;
  for (size_t c = 0; c < 3; ++c) gains[c] = std::exp2(double{offset[c]} + double{slope[c]} * *exposure);
  return gains;
}

std::optional<ExposureResponse> fitExposureResponse(std::span<const std::optional<double>> exposures,
                                                    std::span<const int> trained, std::span<const float> logGains) {
  CHECK(logGains.size() == 3 * exposures.size());
  constexpr size_t kLeastPhotos = 8;
  constexpr double kLeastDeviation = 0.05;                  // stops
  constexpr double kLeastExplained = 0.5;                   // of the variance
  constexpr double kLeastSlope = -0.5, kGreatestSlope = 2;  // what more light does to a photo, with some error
  std::vector<size_t> known;
  for (const int photo : trained)
    if (exposures[static_cast<size_t>(photo)]) known.push_back(static_cast<size_t>(photo));
  if (known.size() < kLeastPhotos) return std::nullopt;
  const auto n = static_cast<double>(known.size());
  double meanExposure = 0;
  for (const size_t i : known) meanExposure += *exposures[i] / n;
  double squares = 0;
  for (const size_t i : known) squares += std::pow(*exposures[i] - meanExposure, 2);
  if (!(squares > n * kLeastDeviation * kLeastDeviation)) return std::nullopt;

  ExposureResponse response;
  double total = 0, left = 0;
  for (size_t c = 0; c < 3; ++c) {
    double mean = 0, products = 0;
    for (const size_t i : known) mean += double{logGains[3 * i + c]} / n;
    for (const size_t i : known) products += (*exposures[i] - meanExposure) * (logGains[3 * i + c] - mean);
    const double slope = products / squares;
    if (!(slope >= kLeastSlope && slope <= kGreatestSlope)) return std::nullopt;
    response.slope[c] = static_cast<float>(slope);
    response.offset[c] = static_cast<float>(mean - slope * meanExposure);
    for (const size_t i : known) {
      const double difference = logGains[3 * i + c] - mean;
      total += difference * difference;
      left += std::pow(difference - slope * (*exposures[i] - meanExposure), 2);
    }
  }
  if (!(left < (1 - kLeastExplained) * total)) return std::nullopt;
  return response;
}

}  // namespace tessera
