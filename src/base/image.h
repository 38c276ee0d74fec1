// An image in memory: rows from top to bottom, interleaved channels, no padding.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tessera {

template <class T>
struct Image {
  int width = 0, height = 0, channels = 0;
  std::vector<T> pixels;  // height × width × channels

  Image() = default;
  Image(int w, int h, int c, T value = T{})
      : width(w), height(h), channels(c), pixels(static_cast<size_t>(w) * h * c, value) {}

  size_t offset(int x, int y) const { return (static_cast<size_t>(y) * width + x) * channels; }
  T* at(int x, int y) { return pixels.data() + offset(x, y); }
  const T* at(int x, int y) const { return pixels.data() + offset(x, y); }
  bool empty() const { return pixels.empty(); }
  size_t pixelCount() const { return static_cast<size_t>(width) * height; }
};

using ImageU8 = Image<uint8_t>;
using ImageF = Image<float>;

ImageF toFloat(const ImageU8& image);  // value / 255
ImageU8 toBytes(const ImageF& image);  // clamp to [0,1], round to nearest

// Downscales by averaging the source area that each target pixel covers (exact for any ratio). Only reduces.
ImageU8 downscaleByArea(const ImageU8& image, int width, int height);
ImageF downscaleByArea(const ImageF& image, int width, int height);

// Returns a photo as viewers show it. `orientation`: of EXIF, 1 to 8; others mean 1.
ImageU8 turnUpright(const ImageU8& image, int orientation);

}  // namespace tessera
