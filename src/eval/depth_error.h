// How far rendered depth lies from measured depth. Both are z-depth, along the optical axis.
// Measures: Eigen, Puhrsch, Fergus, "Depth map prediction from a single image using a multi-scale deep network" (2014).
#pragma once

#include <optional>

#include "base/image.h"

namespace tessera {

struct DepthError {
  double absoluteRelative = 0;  // mean |d − d*| / d*
  double rootMeanSquare = 0;    // world units
  double medianAbsolute = 0;    // world units
  double within125 = 0;         // share of pixels with max(d/d*, d*/d) < 1.25
  size_t pixels = 0;            // how many were compared
};

// `depth` is premultiplied by `opacity` (1 channel each, the same size). `reference`: 1 channel of any size, sampled at
// the nearest pixel, because a mean over an edge is a depth that is nowhere; where it is not finite or not positive
// nothing is known and the pixel is left out, as is a masked pixel (0 in `mask`). Where nothing was drawn the rendered
// depth counts as 0: a hole is an error. Nothing when no pixel can be compared.
std::optional<DepthError> depthError(const ImageF& depth, const ImageF& opacity, const ImageF& reference,
                                     const ImageU8* mask = nullptr);

// The nearest pixel of an image of another size, for masks and depths.
template <class T>
Image<T> resampledToNearest(const Image<T>& image, int width, int height) {
  if (image.width == width && image.height == height) return image;
  Image<T> result(width, height, image.channels);
  for (int y = 0; y < height; ++y) {
    const int sourceY = static_cast<int>((2 * int64_t{y} + 1) * image.height / (2 * int64_t{height}));
    for (int x = 0; x < width; ++x) {
      const int sourceX = static_cast<int>((2 * int64_t{x} + 1) * image.width / (2 * int64_t{width}));
      for (int c = 0; c < image.channels; ++c) result.at(x, y)[c] = image.at(sourceX, sourceY)[c];
    }
  }
  return result;
}

}  // namespace tessera
