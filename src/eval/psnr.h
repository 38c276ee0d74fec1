// Peak signal-to-noise ratio of images in [0, 1]: −10 log10(mean over pixels and channels of (a − b)²), in decibels.
#pragma once

#include "base/image.h"

namespace tessera {

// The value for equal images, so that means and JSON remain finite.
inline constexpr double kMaximumPsnr = 99.0;

// Returns the mean squared difference over pixels and channels. The images must have the same size and number of
// channels. `mask` has one channel of the same size, where 0 excludes a pixel; it may be null. Returns NaN if all
// pixels are excluded.
double meanSquaredError(const ImageF& a, const ImageF& b, const ImageU8* mask = nullptr);
// Return the PSNR in decibels, at most kMaximumPsnr; NaN for NaN.
double psnrFromMeanSquaredError(double error);
double psnr(const ImageF& a, const ImageF& b, const ImageU8* mask = nullptr);

}  // namespace tessera
