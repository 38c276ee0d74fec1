// Image files. The decoders take untrusted bytes: they neither throw nor assert, limit the size that a header may
// claim, and are fuzzed. They return nothing for bytes that cannot be decoded. The functions on files wrap them and
// throw Error naming the path.
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
  bool truncated = false;  // the data ended early: the decoder filled in the rest of the image (grey)
};

// Reads size and format from the first bytes. A PNG with a palette or a transparent colour may have more channels once
// it is decoded.
std::optional<ImageInfo> probeImage(std::span<const std::byte> bytes);
// Decodes a JPEG (grey, colour, CMYK) or PNG (any bit depth, palette, interlaced), recognised by content, not by name.
// Pixels are returned as stored: the EXIF orientation is not applied. Returns nothing for an image whose header claims
// far more pixels than its bytes could encode.
std::optional<DecodedImage> decodeImage(std::span<const std::byte> bytes, const DecodeLimits& limits = {});
// Decodes a depth map: the values of an EXR (scan lines, one part; channel "Z", "R" or the only one), or those of a
// grey PNG times `pngUnitsPerStep`. 0 stays 0 and means that the depth is unknown.
std::optional<ImageF> decodeDepth(std::span<const std::byte> bytes, float pngUnitsPerStep = 0.001f,
                                  const DecodeLimits& limits = {});

ImageInfo probeImageFile(const fs::path& path);  // reads only the start of the file
DecodedImage readImage(const fs::path& path);
ImageF readDepth(const fs::path& path, float pngUnitsPerStep = 0.001f);

Bytes encodePng(const ImageU8& image);  // 1, 3 or 4 channels
// 1 or 3 channels, 4:4:4. `exif` is a TIFF structure, with or without the leading "Exif\0\0", below 64 KiB.
Bytes encodeJpeg(const ImageU8& image, int quality = 95, std::span<const std::byte> exif = {});
Bytes encodeDepthExr(const ImageF& depth);  // one 32-bit float channel "Z", ZIP compressed

void writePng(const fs::path& path, const ImageU8& image);
void writeJpeg(const fs::path& path, const ImageU8& image, int quality = 95, std::span<const std::byte> exif = {});
void writeDepthExr(const fs::path& path, const ImageF& depth);

}  // namespace tessera
