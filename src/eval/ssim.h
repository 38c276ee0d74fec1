// Structural similarity of images in [0, 1].
// Source: Wang, Bovik, Sheikh, Simoncelli, "Image quality assessment: from error visibility to structural similarity"
// (2004), equation 13; Gaussian window 11×11 with σ = 1.5, K1 = 0.01, K2 = 0.03, data range 1.
//
// Only windows that lie wholly inside the image are used (no padding, "valid" windows), as in mip-NeRF 360. The result
// is the mean over windows and channels.
#pragma once

#include "base/image.h"

namespace tessera {

inline constexpr int kSsimWindow = 11;

// a, b: the same size and channels. `mask`: one channel, 0 = masked, may be null; every window that contains a masked
// pixel is ignored. NaN if no window remains (a side below 11 pixels, or the mask).
double ssim(const ImageF& a, const ImageF& b, const ImageU8* mask = nullptr);

}  // namespace tessera
