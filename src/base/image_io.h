// Pictures on disk. Decoders take untrusted bytes: they neither throw nor assert, are bounded by what the header may
// claim, and are fuzzed. The file functions wrap them and throw Error naming the path.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "base/file.h"
#include "base/image.h"

namespace tessera {

struct ImageInfo {
  int width = 0, height = 0, channels = 0;
  enum class Format { jpeg, png, exr } format = Format::jpeg;
};

struct DecodeLimits {
  int64_t maxPixels = int64_t{1} << 29;
};

struct DecodedImage {
  ImageU8 image;           // 1, 3 or 4 channels, straight alpha, sRGB as stored
  bool truncated = false;  // the data ended early: the rest of the picture is what the decoder filled in (grey)
};

// Size and format from the first bytes. A palette or a transparent colour of a PNG can add channels when it is decoded.
std::optional<ImageInfo> probeImage(std::span<const std::byte> bytes);
// JPEG (grey, colour, CMYK) or PNG (any depth, palette, interlaced), by content, not by name. Pixels as stored: EXIF
// orientation is not applied. A picture whose header claims far more pixels than its bytes could hold is refused.
std::optional<DecodedImage> decodeImage(std::span<const std::byte> bytes, const DecodeLimits& limits = {});
// Depth: EXR (scan lines, one part; the channel "Z", "R" or the only one) as it is; grey PNG as integer × unitsPerStep.
// 0 stays 0: "nothing known here".
std::optional<ImageF> decodeDepth(std::span<const std::byte> bytes, float pngUnitsPerStep = 0.001f,
                                  const DecodeLimits& limits = {});

ImageInfo probeImageFile(const fs::path& path);  // reads only the head of the file
DecodedImage readImage(const fs::path& path);
ImageF readDepth(const fs::path& path, float pngUnitsPerStep = 0.001f);

Bytes encodePng(const ImageU8& image);  // 1, 3 or 4 channels
// 1 or 3 channels, 4:4:4. `exif`: a TIFF structure, with or without the leading "Exif\0\0", below 64 KiB.
Bytes encodeJpeg(const ImageU8& image, int quality = 95, std::span<const std::byte> exif = {});
Bytes encodeDepthExr(const ImageF& depth);  // one 32-bit float channel "Z", ZIP compressed

void writePng(const fs::path& path, const ImageU8& image);
void writeJpeg(const fs::path& path, const ImageU8& image, int quality = 95, std::span<const std::byte> exif = {});
void writeDepthExr(const fs::path& path, const ImageF& depth);

}  // namespace tessera
