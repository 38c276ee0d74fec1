#include "import/photo_files.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/image_io.h"
#include "base/leftovers.h"
#include "base/log.h"

namespace tessera {
namespace {

void linkOrCopy(const fs::path& source, const fs::path& target) {
  std::error_code status;
  fs::create_directories(target.parent_path(), status);
  const fs::path partial = partialPlace(target);
  fs::remove(partial, status);
  // Of a symbolic link, its file: a link to a symbolic link would be another one.
  const fs::path file = fs::canonical(source, status);
  if (!status) fs::create_hard_link(file, partial, status);
  if (status) fs::copy_file(source, partial, fs::copy_options::overwrite_existing, status);
  if (!status) fs::rename(partial, target, status);
  // POSIX leaves both names in place when a link is renamed over another link to the same file.
  std::error_code ignored;
  fs::remove(partial, ignored);
  if (status)
    throw Error(target.string(), "", "could not be written: " + status.message(), "check free space and permissions");
}

// Downscales with colours weighted by alpha, so that the colour of transparent pixels does not bleed.
ImageU8 reduceWithAlpha(const ImageU8& image, int width, int height) {
  ImageF premultiplied = toFloat(image);
  for (size_t i = 0; i < premultiplied.pixelCount(); ++i) {
    float* pixel = premultiplied.pixels.data() + 4 * i;
    for (int c = 0; c < 3; ++c) pixel[c] *= pixel[3];
  }
  ImageF reduced = downscaleByArea(premultiplied, width, height);
  for (size_t i = 0; i < reduced.pixelCount(); ++i) {
    float* pixel = reduced.pixels.data() + 4 * i;
    for (int c = 0; c < 3 && pixel[3] > 0; ++c) pixel[c] /= pixel[3];
  }
  return toBytes(reduced);
}

// Resamples to any size, including larger ones, with the nearest source pixel.
template <class T>
Image<T> nearestSamples(const Image<T>& image, int width, int height) {
  Image<T> out(width, height, image.channels);
  for (int y = 0; y < height; ++y) {
    const int fromY = std::min(static_cast<int>((y + 0.5) * image.height / height), image.height - 1);
    for (int x = 0; x < width; ++x) {
      const int fromX = std::min(static_cast<int>((x + 0.5) * image.width / width), image.width - 1);
      std::copy_n(image.at(fromX, fromY), image.channels, out.at(x, y));
    }
  }
  return out;
}

}  // namespace

bool isReady(const fs::path& source, const fs::path& target, int width, int height) {
  std::error_code status;
  if (!fs::is_regular_file(target, status)) return false;
  const auto sourceTime = fs::last_write_time(source, status);
  if (status) return false;
  const auto targetTime = fs::last_write_time(target, status);
  if (status || targetTime < sourceTime) return false;
  try {
    const ImageInfo info = probeImageFile(target);
    return info.width == width && info.height == height;
  } catch (const Error&) {
    return false;
  }
}

FileOutcome importPhoto(const fs::path& source, const fs::path& target, int width, int height) {
  std::error_code status;
  // Imported in place, it has not been decoded before.
  const bool isInPlace = fs::weakly_canonical(source, status) == fs::weakly_canonical(target, status);
  if (!isInPlace && isReady(source, target, width, height)) return FileOutcome::ready;
  const auto decoded = decodeImage(readFile(source));
  if (!decoded) return FileOutcome::unreadable;
  if (decoded->truncated) return FileOutcome::truncated;
  const ImageU8& image = decoded->image;
  if (image.width == width && image.height == height) {
    if (!isInPlace) linkOrCopy(source, target);
    return FileOutcome::ready;
  }
  if (image.width < width || image.height < height) return FileOutcome::unreadable;  // contradicts the header
  const ImageU8 reduced =
      image.channels == 4 ? reduceWithAlpha(image, width, height) : downscaleByArea(image, width, height);
  if (target.extension() == ".png") {
    writePng(target, reduced);
  } else {
    writeJpeg(target, reduced, 98);
  }
  return FileOutcome::ready;
}

ImageU8 toMask(const ImageU8& image, bool inverted) {
  const int colours = std::min(image.channels, 3);
  ImageU8 mask(image.width, image.height, 1);
  for (size_t i = 0; i < image.pixelCount(); ++i) {
    const uint8_t* pixel = image.pixels.data() + i * static_cast<size_t>(image.channels);
    // In nerfstudio's masks black is masked; in instant-ngp's dynamic masks everything except black is masked.
    const int brightest = *std::max_element(pixel, pixel + colours);
    mask.pixels[i] = (inverted ? brightest == 0 : brightest >= 128) ? 255 : 0;
  }
  return mask;
}

bool excludesAll(const ImageU8& mask) {
  return std::all_of(mask.pixels.begin(), mask.pixels.end(), [](uint8_t value) { return value == 0; });
}

void warnOfExcluded(const std::vector<std::string>& photos, size_t count, const fs::path& masks) {
  if (photos.empty()) return;
  if (photos.size() == count) {
    throw Error(masks.string(), "", "excludes all pixels of all photos",
                "make white what is to be used: what is less than half as bright is excluded");
  }
  warn("masks exclude all pixels of {} photos ({}{})", photos.size(), photos[0], photos.size() > 1 ? ", ..." : "");
}

std::optional<ImageU8> readMask(const fs::path& source, int width, int height, bool inverted) {
  std::error_code status;
  if (!fs::is_regular_file(source, status)) return std::nullopt;
  const auto decoded = decodeImage(readFile(source));
  if (!decoded) return std::nullopt;
  ImageU8 mask = toMask(decoded->image, inverted);
  if (mask.width < width || mask.height < height) return nearestSamples(mask, width, height);
  mask = downscaleByArea(mask, width, height);
  for (uint8_t& value : mask.pixels) value = value == 255 ? 255 : 0;
  return mask;
}

FileOutcome importMask(const fs::path& source, const fs::path& target, int width, int height, bool inverted) {
  if (isReady(source, target, width, height)) return FileOutcome::ready;
  const auto mask = readMask(source, width, height, inverted);
  if (!mask) return FileOutcome::unreadable;
  writePng(target, *mask);
  return FileOutcome::ready;
}

FileOutcome importDepth(const fs::path& source, const fs::path& target, int width, int height,
                        const DepthUnits& units) {
  const auto [unit, scale] = units;
  std::error_code status;
  if (!fs::is_regular_file(source, status)) return FileOutcome::unreadable;
  const Bytes bytes = readFile(source);
  const auto info = probeImage(bytes);
  auto depth = decodeDepth(bytes, unit);
  if (!info || !depth) return FileOutcome::unreadable;
  const bool isExr = info->format == ImageInfo::Format::exr;
  if (isExr && scale == 1 && depth->width == width && depth->height == height) {
    linkOrCopy(source, target);
    return FileOutcome::ready;
  }
  if (depth->width != width || depth->height != height) depth = nearestSamples(*depth, width, height);
  if (isExr) {
    for (float& value : depth->pixels) value *= static_cast<float>(scale);
  }
  writeDepthExr(target, *depth);
  return FileOutcome::ready;
}

}  // namespace tessera
