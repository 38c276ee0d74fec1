// Structural similarity of pictures in [0, 1].
// Source: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment: from error visibility to structural similarity"
// (2004), equation 13; Gaussian window 11×11 with σ = 1.5, K1 = 0.01, K2 = 0.03, data range 1.
//
// "Valid" windows: only windows that lie wholly inside the picture count (no padding), as in mip-NeRF 360. Per channel,
// then the mean over windows and channels.
#pragma once

#include "base/image.h"

namespace tessera {

inline constexpr int kSsimWindow = 11;

// a, b: the same size and channels. `mask`: one channel, 0 = masked; every window that holds a masked pixel is left
// out. NaN when no window remains (a side below 11 pixels, or the mask).
double ssim(const ImageF& a, const ImageF& b, const ImageU8* mask = nullptr);

}  // namespace tessera
