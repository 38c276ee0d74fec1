// Which frames of a video become photos: neighbours show nearly the same, and many are blurred by motion.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/image.h"

namespace tessera {

inline constexpr int kMaxDefaultFrames = 200;
inline constexpr double kShortestInterval = 0.25;  // seconds

// Returns how sharp a grey image is: the variance of its Laplacian, relative to the square of its mean, so that a
// darker picture of the same place counts as equally sharp. Comparable among images of one size.
// Source: Pech-Pacheco et al., "Diatom autofocusing in brightfield microscopy", 2000 (variance of the Laplacian).
double imageSharpness(const ImageU8& grey);

// Divides the time between the first and the last frame into `count` equal intervals, and returns the sharpest frame of
// each: indices, ascending. A frame follows the one before it after at least half an interval; where no frame does, as
// in a pause of a variable frame rate, an interval has none. `count` 0: intervals of kShortestInterval, but at least
// three and at most kMaxDefaultFrames. `times` in seconds, in order of presentation.
std::vector<size_t> chooseFrames(std::span<const double> times, std::span<const double> sharpness, int count);

}  // namespace tessera
