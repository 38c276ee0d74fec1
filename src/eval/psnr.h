// Peak signal-to-noise ratio of images in [0, 1]: −10 log10(mean over pixels and channels of (a − b)²), in decibels.
#pragma once

#include "base/image.h"

namespace tessera {

// The value for equal images, so that means and JSON remain finite.
inline constexpr double kMaximumPsnr = 99.0;

// a, b: the same size and channels. `mask`: one channel of the same size, 0 = ignore the pixel; may be null.
// NaN if all pixels are masked.
double meanSquaredError(const ImageF& a, const ImageF& b, const ImageU8* mask = nullptr);
double psnrFromMeanSquaredError(double error);
double psnr(const ImageF& a, const ImageF& b, const ImageU8* mask = nullptr);

}  // namespace tessera
