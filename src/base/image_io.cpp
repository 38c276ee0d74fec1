#include "base/image_io.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "base/error.h"
#include "base/image_codecs.h"

namespace tessera {

namespace image_codecs {

bool isPlausible(int64_t width, int64_t height, size_t bytes, const DecodeLimits& limits) {
  if (width < 1 || height < 1 || height > limits.maxPixels / width) return false;
  // Deflate reaches 1032 bytes per byte and eight 1-bit pixels to each; a JPEG block of 64 pixels takes two bits.
  constexpr int64_t kPixelsPerByte = 8 * 1032;
  constexpr int64_t kAlwaysFine = int64_t{1} << 20;
  return width * height <= std::max(kAlwaysFine, static_cast<int64_t>(bytes) * kPixelsPerByte);
}

}  // namespace image_codecs

using namespace image_codecs;

namespace {

[[noreturn]] void failReading(const fs::path& path, const std::string& kind) {
  throw Error(path.string(), "", "cannot be decoded as " + kind, "check the file, or take it out of the capture");
}

}  // namespace

std::optional<ImageInfo> probeImage(std::span<const std::byte> bytes) {
  if (isJpeg(bytes)) return probeJpeg(bytes);
  if (isPng(bytes)) return probePng(bytes);
  if (isExr(bytes)) return probeExr(bytes);
  return std::nullopt;
}

std::optional<DecodedImage> decodeImage(std::span<const std::byte> bytes, const DecodeLimits& limits) {
  if (isJpeg(bytes)) return decodeJpeg(bytes, limits);
  if (isPng(bytes)) return decodePng(bytes, limits);
  return std::nullopt;
}

std::optional<ImageF> decodeDepth(std::span<const std::byte> bytes, float pngUnitsPerStep, const DecodeLimits& limits) {
  if (isExr(bytes)) return decodeExrDepth(bytes, limits);
  if (isPng(bytes)) return decodePngDepth(bytes, pngUnitsPerStep, limits);
  return std::nullopt;
}

ImageInfo probeImageFile(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error(path.string(), "", std::strerror(errno), "check the path and its permissions");
  // Nearly always the first piece is enough; colour profiles and previews can push a JPEG's size further back.
  constexpr size_t kFirst = size_t{64} << 10, kMax = size_t{64} << 20;
  Bytes head;
  for (size_t length = kFirst; length <= kMax; length *= 8) {
    const size_t had = head.size();
    head.resize(length);
    in.read(reinterpret_cast<char*>(head.data() + had), static_cast<std::streamsize>(length - had));
    head.resize(had + static_cast<size_t>(in.gcount()));
    if (const auto info = probeImage(head)) return *info;
    if (!in) break;
  }
  failReading(path, "JPEG, PNG or EXR");
}

DecodedImage readImage(const fs::path& path) {
  auto decoded = decodeImage(readFile(path));
  if (!decoded) failReading(path, "JPEG or PNG");
  return std::move(*decoded);
}

ImageF readDepth(const fs::path& path, float pngUnitsPerStep) {
  auto depth = decodeDepth(readFile(path), pngUnitsPerStep);
  if (!depth) failReading(path, "depth (EXR, or PNG with one channel)");
  return std::move(*depth);
}

void writePng(const fs::path& path, const ImageU8& image) {
  writeFileAtomically(path, encodePng(image));
}
void writeJpeg(const fs::path& path, const ImageU8& image, int quality, std::span<const std::byte> exif) {
  writeFileAtomically(path, encodeJpeg(image, quality, exif));
}
void writeDepthExr(const fs::path& path, const ImageF& depth) {
  writeFileAtomically(path, encodeDepthExr(depth));
}

}  // namespace tessera
