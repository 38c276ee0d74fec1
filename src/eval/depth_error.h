// Errors of rendered depth against measured depth. Both are z-depth, along the optical axis.
// Source of the measures: Eigen, Puhrsch, Fergus, "Depth map prediction from a single image using a multi-scale deep
// network" (2014).
#pragma once

#include <optional>

#include "base/image.h"

namespace tessera {

struct DepthError {
  double absoluteRelative = 0;  // mean |d − d*| / d*
  double rootMeanSquare = 0;    // world units
  double medianAbsolute = 0;    // world units
  double within125 = 0;         // share of the pixels with max(d/d*, d*/d) < 1.25
  size_t pixels = 0;            // number of compared pixels
};

// `depth` is premultiplied by `opacity` (1 channel each, the same size). `reference` has 1 channel and any size, and is
// sampled at the nearest pixel, because an average across an edge is a depth that exists nowhere. Pixels whose
// reference is not finite or not positive, and masked pixels (0 in `mask`), are ignored. Where nothing was rendered the
// depth counts as 0: a hole is an error. Returns nothing if no pixel can be compared.
std::optional<DepthError> depthError(const ImageF& depth, const ImageF& opacity, const ImageF& reference,
                                     const ImageU8* mask = nullptr);

// Resamples an image, a mask or depths, to another size by taking the nearest pixel.
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
