#include "pipeline/thumbnail.h"

#include <algorithm>
#include <cmath>
#include <new>

#include "base/error.h"
#include "base/image_io.h"

namespace tessera {
namespace {

constexpr int kThumbnailQuality = 80;

// JPEG has no alpha.
ImageU8 withoutAlpha(ImageU8 image) {
  if (image.channels != 4) return image;
  ImageU8 opaque(image.width, image.height, 3);
  for (size_t i = 0; i < image.pixelCount(); ++i)
    std::copy_n(image.pixels.begin() + static_cast<std::ptrdiff_t>(4 * i), 3,
                opaque.pixels.begin() + static_cast<std::ptrdiff_t>(3 * i));
  return opaque;
}

}  // namespace

std::optional<Thumbnail> makeThumbnail(const fs::path& photo, int orientation, int longestSide) {
  try {
    const ImageU8 image = withoutAlpha(readImage(photo).image);
    const double scale = std::min(1.0, static_cast<double>(longestSide) / std::max(image.width, image.height));
    const auto scaled = [scale](int side) { return std::max(1, static_cast<int>(std::lround(side * scale))); };
    const ImageU8 upright = turnUpright(downscaleByArea(image, scaled(image.width), scaled(image.height)), orientation);
    return Thumbnail{upright.width, upright.height, encodeJpeg(upright, kThumbnailQuality)};
  } catch (const Error&) {
    return std::nullopt;
  } catch (const std::bad_alloc&) {
    return std::nullopt;
  }
}

}  // namespace tessera
