#include "eval/psnr.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/check.h"

namespace tessera {

double meanSquaredError(const ImageF& a, const ImageF& b, const ImageU8* mask) {
  CHECK(a.width == b.width);
  CHECK(a.height == b.height);
  CHECK(a.channels == b.channels);
  if (mask) {
    CHECK(mask->width == a.width);
    CHECK(mask->height == a.height);
  }
  double sum = 0;
  size_t count = 0;
  const auto channels = static_cast<size_t>(a.channels);
  for (size_t pixel = 0; pixel < a.pixelCount(); ++pixel) {
    if (mask && mask->pixels[pixel * mask->channels] == 0) continue;
    for (size_t i = pixel * channels; i < (pixel + 1) * channels; ++i) {
      const double difference = double{a.pixels[i]} - double{b.pixels[i]};
      sum += difference * difference;
    }
    count += channels;
  }
  return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
}

double psnrFromMeanSquaredError(double error) {
  if (std::isnan(error)) return error;
  return error > 0 ? std::min(kMaximumPsnr, -10.0 * std::log10(error)) : kMaximumPsnr;
}

double psnr(const ImageF& a, const ImageF& b, const ImageU8* mask) {
  return psnrFromMeanSquaredError(meanSquaredError(a, b, mask));
}

}  // namespace tessera
