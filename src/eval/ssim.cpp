#include "eval/ssim.h"

#include <array>
#include <cmath>
#include <limits>

#include "base/check.h"

namespace tessera {
namespace {

constexpr double kSigma = 1.5, kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;

std::array<double, kSsimWindow> gaussianWindow() {
  std::array<double, kSsimWindow> weights{};
  double sum = 0;
  for (int i = 0; i < kSsimWindow; ++i) {
    const double x = i - kSsimWindow / 2;
    sum += weights[static_cast<size_t>(i)] = std::exp(-x * x / (2 * kSigma * kSigma));
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

// The five window means in the formula.
struct Moments {
  double x = 0, y = 0, xx = 0, yy = 0, xy = 0;

  void add(double weight, const Moments& other) {
    x += weight * other.x;
    y += weight * other.y;
    xx += weight * other.xx;
    yy += weight * other.yy;
    xy += weight * other.xy;
  }
};

double similarity(const Moments& m) {
  const double varianceX = m.xx - m.x * m.x, varianceY = m.yy - m.y * m.y, covariance = m.xy - m.x * m.y;
  return (2 * m.x * m.y + kC1) * (2 * covariance + kC2) /
         ((m.x * m.x + m.y * m.y + kC1) * (varianceX + varianceY + kC2));
}

// Returns the summed-area table of masked pixels, (width + 1) × (height + 1).
std::vector<uint32_t> summedMask(const ImageU8& mask) {
  const size_t stride = static_cast<size_t>(mask.width) + 1;
  std::vector<uint32_t> sums(stride * (static_cast<size_t>(mask.height) + 1), 0);
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      const size_t i = (static_cast<size_t>(y) + 1) * stride + static_cast<size_t>(x) + 1;
      sums[i] = sums[i - 1] + sums[i - stride] - sums[i - stride - 1] + (mask.at(x, y)[0] == 0 ? 1 : 0);
    }
  }
  return sums;
}

}  // namespace

double ssim(const ImageF& a, const ImageF& b, const ImageU8* mask) {
  CHECK(a.width == b.width);
  CHECK(a.height == b.height);
  CHECK(a.channels == b.channels);
  std::vector<uint32_t> masked;
  if (mask) {
    CHECK(mask->width == a.width);
    CHECK(mask->height == a.height);
    masked = summedMask(*mask);
  }
  const int across = a.width - kSsimWindow + 1, down = a.height - kSsimWindow + 1;
  if (across < 1 || down < 1) return std::numeric_limits<double>::quiet_NaN();
  const auto weights = gaussianWindow();
  const auto stride = static_cast<size_t>(a.width) + 1;
  const auto hasMasked = [&](int x, int y) {
    const size_t top = static_cast<size_t>(y) * stride + static_cast<size_t>(x), bottom = top + kSsimWindow * stride;
    return masked[bottom + kSsimWindow] + masked[top] != masked[bottom] + masked[top + kSsimWindow];
  };

  double sum = 0;
  size_t count = 0;
  std::vector<Moments> column(static_cast<size_t>(a.width));  // one channel of eleven rows, filtered vertically
  for (int c = 0; c < a.channels; ++c) {
    for (int y = 0; y < down; ++y) {
      for (int x = 0; x < a.width; ++x) {
        Moments& moments = column[static_cast<size_t>(x)] = {};
        for (int j = 0; j < kSsimWindow; ++j) {
          const double p = a.at(x, y + j)[c], q = b.at(x, y + j)[c];
          moments.add(weights[static_cast<size_t>(j)], {p, q, p * p, q * q, p * q});
        }
      }
      for (int x = 0; x < across; ++x) {
        if (mask && hasMasked(x, y)) continue;
        Moments moments;
        for (size_t i = 0; i < kSsimWindow; ++i) moments.add(weights[i], column[static_cast<size_t>(x) + i]);
        sum += similarity(moments);
        ++count;
      }
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace tessera
