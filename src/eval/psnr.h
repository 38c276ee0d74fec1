// Peak signal-to-noise ratio of pictures in [0, 1]: −10 log10(mean over pixels and channels of (a − b)²), in decibels.
#pragma once

#include "base/image.h"

namespace tessera {

// What equal pictures get, so that means and JSON stay finite.
inline constexpr double kMaximumPsnr = 99.0;

// a, b: the same size and channels. `mask`: one channel of the same size, 0 = leave the pixel out; may be null.
// NaN when the mask leaves nothing.
double meanSquaredError(const ImageF& a, const ImageF& b, const ImageU8* mask = nullptr);
double psnrFromMeanSquaredError(double error);
double psnr(const ImageF& a, const ImageF& b, const ImageU8* mask = nullptr);

}  // namespace tessera
