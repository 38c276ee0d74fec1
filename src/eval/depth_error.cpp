#include "eval/depth_error.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/check.h"

namespace tessera {

std::optional<DepthError> depthError(const ImageF& depth, const ImageF& opacity, const ImageF& reference,
                                     const ImageU8* mask) {
  constexpr float kMinOpacity = 1e-3f;
  CHECK(depth.channels == 1);
  CHECK(opacity.channels == 1);
  CHECK(reference.channels == 1);
  CHECK(depth.pixels.size() == opacity.pixels.size());
  if (mask) CHECK(mask->pixelCount() == depth.pixelCount());
  const ImageF truth = resampledToNearest(reference, depth.width, depth.height);
  DepthError error;
  std::vector<float> differences;
  double relative = 0, squares = 0;
  size_t within = 0;
  for (size_t i = 0; i < depth.pixels.size(); ++i) {
    const double expected = truth.pixels[i];
    if (!std::isfinite(expected) || expected <= 0) continue;
    if (mask && mask->pixels[i * mask->channels] == 0) continue;
    const double rendered = opacity.pixels[i] > kMinOpacity ? double{depth.pixels[i]} / opacity.pixels[i] : 0.0;
    const double difference = std::abs(rendered - expected);
    relative += difference / expected;
    squares += difference * difference;
    if (rendered > 0 && std::max(rendered / expected, expected / rendered) < 1.25) ++within;
    differences.push_back(static_cast<float>(difference));
  }
  if (differences.empty()) return std::nullopt;
  error.pixels = differences.size();
  const auto count = static_cast<double>(error.pixels);
  error.absoluteRelative = relative / count;
  error.rootMeanSquare = std::sqrt(squares / count);
  error.within125 = static_cast<double>(within) / count;
  const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  error.medianAbsolute = *middle;
  if (differences.size() % 2 == 0) {
    error.medianAbsolute = (error.medianAbsolute + *std::max_element(differences.begin(), middle)) / 2;
  }
  return error;
}

}  // namespace tessera
