#include "eval/ssim.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace tessera {
namespace {

ImageF noise(int width, int height, int channels, uint64_t seed) {
  ImageF image(width, height, channels);
  const RandomStream random(seed, 0);
  for (size_t i = 0; i < image.pixels.size(); ++i) image.pixels[i] = random.uniform(i);
  return image;
}

// The formula of the paper, with explicit two-dimensional windows and central moments.
double bruteForce(const ImageF& a, const ImageF& b, const ImageU8* mask) {
  double sum = 0;
  int count = 0;
  for (int c = 0; c < a.channels; ++c) {
    for (int y = 5; y + 5 < a.height; ++y) {
      for (int x = 5; x + 5 < a.width; ++x) {
        double total = 0, meanA = 0, meanB = 0, varianceA = 0, varianceB = 0, covariance = 0;
        bool isUnmasked = true;
        const auto each = [&](auto&& visit) {
          for (int j = -5; j <= 5; ++j) {
            for (int i = -5; i <= 5; ++i) visit(std::exp(-(i * i + j * j) / 4.5), x + i, y + j);
          }
        };
        each([&](double w, int u, int v) {
          total += w;
          meanA += w * a.at(u, v)[c];
          meanB += w * b.at(u, v)[c];
          if (mask && mask->at(u, v)[0] == 0) isUnmasked = false;
        });
        if (!isUnmasked) continue;
        meanA /= total;
        meanB /= total;
        each([&](double w, int u, int v) {
          varianceA += w / total * std::pow(a.at(u, v)[c] - meanA, 2);
          varianceB += w / total * std::pow(b.at(u, v)[c] - meanB, 2);
          covariance += w / total * (a.at(u, v)[c] - meanA) * (b.at(u, v)[c] - meanB);
        });
        sum += (2 * meanA * meanB + 1e-4) * (2 * covariance + 9e-4) /
               ((meanA * meanA + meanB * meanB + 1e-4) * (varianceA + varianceB + 9e-4));
        ++count;
      }
    }
  }
  return sum / count;
}

TEST(Ssim, IsOneForEqualImages) {
  EXPECT_NEAR(ssim(noise(20, 15, 3, 1), noise(20, 15, 3, 1)), 1.0, 1e-9);
}

TEST(Ssim, IsSymmetric) {
  const ImageF a = noise(20, 15, 3, 1), b = noise(20, 15, 3, 2);
  EXPECT_DOUBLE_EQ(ssim(a, b), ssim(b, a));
  EXPECT_LT(ssim(a, b), 0.3);
}

TEST(Ssim, FollowsTheLuminanceTermForConstantImages) {
  const double a = 0.25, b = 0.75;
  EXPECT_NEAR(ssim(ImageF(16, 16, 1, 0.25f), ImageF(16, 16, 1, 0.75f)), (2 * a * b + 1e-4) / (a * a + b * b + 1e-4),
              1e-9);
}

TEST(Ssim, AgreesWithTheFormulaWrittenOut) {
  const ImageF a = noise(17, 14, 3, 3);
  ImageF b = noise(17, 14, 3, 4);
  for (size_t i = 0; i < b.pixels.size(); ++i) b.pixels[i] = 0.7f * a.pixels[i] + 0.2f * b.pixels[i];
  EXPECT_NEAR(ssim(a, b), bruteForce(a, b, nullptr), 1e-9);
}

TEST(Ssim, IgnoresEveryWindowThatTouchesAMaskedPixel) {
  const ImageF a = noise(30, 24, 2, 5), b = noise(30, 24, 2, 6);
  ImageU8 mask(30, 24, 1, 255);
  mask.at(3, 4)[0] = 0;
  mask.at(25, 12)[0] = 0;
  EXPECT_NEAR(ssim(a, b, &mask), bruteForce(a, b, &mask), 1e-9);
  ImageF changed = b;  // masked pixels have no effect
  changed.at(3, 4)[0] = 9.0f;
  EXPECT_DOUBLE_EQ(ssim(a, b, &mask), ssim(a, changed, &mask));
}

TEST(Ssim, IsUndefinedWithoutAWholeWindow) {
  EXPECT_TRUE(std::isnan(ssim(ImageF(10, 40, 1), ImageF(10, 40, 1))));
  const ImageU8 nothing(20, 20, 1, 0);
  EXPECT_TRUE(std::isnan(ssim(ImageF(20, 20, 1), ImageF(20, 20, 1), &nothing)));
  EXPECT_DOUBLE_EQ(ssim(ImageF(11, 11, 1), ImageF(11, 11, 1)), 1.0);
}

}  // namespace
}  // namespace tessera
