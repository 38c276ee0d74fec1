#include "eval/psnr.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

namespace tessera {
namespace {

TEST(Psnr, IsExactForConstantDifferences) {
  const ImageF black(4, 3, 3, 0.0f);
  EXPECT_NEAR(psnr(black, ImageF(4, 3, 3, 0.1f)), 20.0, 1e-5);
  EXPECT_NEAR(psnr(black, ImageF(4, 3, 3, 0.01f)), 40.0, 1e-5);
  EXPECT_NEAR(psnr(black, ImageF(4, 3, 3, 1.0f)), 0.0, 1e-12);
  ImageF half = black;
  for (size_t i = 0; i < half.pixels.size() / 2; ++i) half.pixels[i] = 0.1f;
  EXPECT_NEAR(psnr(black, half), 20.0 + 10 * std::log10(2.0), 1e-5);
}

TEST(Psnr, IsCappedForEqualImages) {
  EXPECT_EQ(psnr(ImageF(2, 2, 3, 0.3f), ImageF(2, 2, 3, 0.3f)), kMaximumPsnr);
  EXPECT_EQ(psnr(ImageF(2, 2, 3, 0.3f), ImageF(2, 2, 3, 0.30000004f)), kMaximumPsnr);
}

TEST(Psnr, IgnoresMaskedPixels) {
  ImageF a(2, 1, 3, 0.5f), b = a;
  for (int c = 0; c < 3; ++c) {
    a.at(0, 0)[c] = 0.0f;
    b.at(0, 0)[c] = 1.0f;  // wrong, but masked
    b.at(1, 0)[c] = 0.6f;
  }
  ImageU8 mask(2, 1, 1, 255);
  mask.at(0, 0)[0] = 0;
  EXPECT_NEAR(psnr(a, b, &mask), 20.0, 1e-5);
  EXPECT_TRUE(std::isnan(psnr(a, b, std::make_unique<ImageU8>(2, 1, 1, uint8_t{0}).get())));
}

}  // namespace
}  // namespace tessera
