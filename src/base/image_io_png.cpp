// PNG through libspng.
#include <spng.h>

#include <cstring>
#include <memory>

#include "base/check.h"
#include "base/image_codecs.h"

namespace tessera {
namespace {

constexpr size_t kMaximumMetadataChunk = size_t{64} << 20;  // texts and profiles; image data is not stored as a chunk

using Codec = std::unique_ptr<spng_ctx, decltype(&spng_ctx_free)>;

struct OpenPng {
  Codec codec{nullptr, spng_ctx_free};
  spng_ihdr header{};
  bool hasTransparentColour = false;
};

std::optional<OpenPng> open(std::span<const std::byte> bytes, const DecodeLimits& limits) {
  OpenPng png;
  png.codec.reset(spng_ctx_new(0));
  if (!png.codec) return std::nullopt;
  spng_ctx* codec = png.codec.get();
  spng_set_chunk_limits(codec, kMaximumMetadataChunk, kMaximumMetadataChunk);
  if (spng_set_png_buffer(codec, bytes.data(), bytes.size()) != 0) return std::nullopt;
  if (spng_get_ihdr(codec, &png.header) != 0) return std::nullopt;
  if (!image_codecs::isPlausible(png.header.width, png.header.height, bytes.size(), limits)) return std::nullopt;
  spng_trns transparency;
  png.hasTransparentColour = spng_get_trns(codec, &transparency) == 0;
  return png;
}

// Decodes rows into `pixels` (rowBytes each, in the layout of `format`). Returns how many steps succeeded before the
// end or an error, and whether it was the regular end.
struct Rows {
  int decoded = 0;
  bool complete = false;
};

Rows decodeRows(spng_ctx* codec, int format, int flags, uint8_t* pixels, size_t rowBytes) {
  Rows rows;
  if (spng_decode_image(codec, nullptr, 0, format, flags | SPNG_DECODE_PROGRESSIVE) != 0) return rows;
  for (;;) {
    spng_row_info row;
    int status = spng_get_row_info(codec, &row);
    if (status == 0) status = spng_decode_row(codec, pixels + row.row_num * rowBytes, rowBytes);
    if (status == 0 || status == SPNG_EOI) ++rows.decoded;
    if (status == 0) continue;
    rows.complete = status == SPNG_EOI;
    return rows;
  }
}

uint32_t bigEndian32(std::span<const std::byte> bytes, size_t at) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<uint32_t>(bytes[at + i]);
  return value;
}

// Decodes one channel as 16-bit numbers, whatever the stored bit depth, without rescaling the values.
std::optional<std::vector<uint16_t>> decodeGrey16(OpenPng& png, bool& truncated) {
  const int width = static_cast<int>(png.header.width), height = static_cast<int>(png.header.height);
  std::vector<uint16_t> wide(static_cast<size_t>(width) * height, png.header.bit_depth == 16 ? 0x8080 : 0x80);
  Rows rows;
  if (png.header.bit_depth == 16) {
    rows = decodeRows(png.codec.get(), SPNG_FMT_PNG, 0, reinterpret_cast<uint8_t*>(wide.data()), width * size_t{2});
  } else {
    std::vector<uint8_t> narrow(wide.size(), 0x80);
    rows = decodeRows(png.codec.get(), SPNG_FMT_G8, 0, narrow.data(), static_cast<size_t>(width));
    std::copy(narrow.begin(), narrow.end(), wide.begin());
  }
  truncated = !rows.complete;
  if (rows.decoded == 0) return std::nullopt;
  return wide;
}

}  // namespace

namespace image_codecs {

bool isPng(std::span<const std::byte> bytes) {
  static constexpr unsigned char kSignature[8] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  return bytes.size() >= 8 && std::memcmp(bytes.data(), kSignature, 8) == 0;
}

std::optional<ImageInfo> probePng(std::span<const std::byte> bytes) {
  if (bytes.size() < 26 || std::memcmp(bytes.data() + 12, "IHDR", 4) != 0) return std::nullopt;
  const uint32_t width = bigEndian32(bytes, 16), height = bigEndian32(bytes, 20);
  const int type = static_cast<int>(bytes[25]);
  if (width == 0 || height == 0 || width > INT32_MAX || height > INT32_MAX) return std::nullopt;
  const int channels = type == 0 ? 1 : type == 4 || type == 6 ? 4 : 3;
  return ImageInfo{static_cast<int>(width), static_cast<int>(height), channels, ImageInfo::Format::png};
}

std::optional<DecodedImage> decodePng(std::span<const std::byte> bytes, const DecodeLimits& limits) {
  auto png = open(bytes, limits);
  if (!png) return std::nullopt;
  const int width = static_cast<int>(png->header.width), height = static_cast<int>(png->header.height);
  const int type = png->header.color_type;
  DecodedImage result;
  if (type == SPNG_COLOR_TYPE_GRAYSCALE && !png->hasTransparentColour) {
    const auto grey = decodeGrey16(*png, result.truncated);
    if (!grey) return std::nullopt;
    result.image = ImageU8(width, height, 1);
    const uint32_t maximum = png->header.bit_depth == 16 ? 65535 : 255;
    for (size_t i = 0; i < grey->size(); ++i) {
      result.image.pixels[i] = static_cast<uint8_t>(((*grey)[i] * 255u + maximum / 2) / maximum);
    }
    return result;
  }
  const bool hasAlpha =
      png->hasTransparentColour || type == SPNG_COLOR_TYPE_GRAYSCALE_ALPHA || type == SPNG_COLOR_TYPE_TRUECOLOR_ALPHA;
  result.image = ImageU8(width, height, hasAlpha ? 4 : 3, 128);
  const Rows rows = decodeRows(png->codec.get(), hasAlpha ? SPNG_FMT_RGBA8 : SPNG_FMT_RGB8,
                               png->hasTransparentColour ? SPNG_DECODE_TRNS : 0, result.image.pixels.data(),
                               static_cast<size_t>(width) * result.image.channels);
  if (rows.decoded == 0) return std::nullopt;
  result.truncated = !rows.complete;
  return result;
}

std::optional<ImageF> decodePngDepth(std::span<const std::byte> bytes, float unitsPerStep, const DecodeLimits& limits) {
  auto png = open(bytes, limits);
  // Below 8 bits libspng rescales the values to the full byte, which would change the distances.
  if (!png || png->header.color_type != SPNG_COLOR_TYPE_GRAYSCALE || png->header.bit_depth < 8) return std::nullopt;
  bool truncated = false;
  const auto steps = decodeGrey16(*png, truncated);
  if (!steps || truncated) return std::nullopt;  // filled-in distances would be wrong
  ImageF depth(static_cast<int>(png->header.width), static_cast<int>(png->header.height), 1);
  for (size_t i = 0; i < steps->size(); ++i) depth.pixels[i] = static_cast<float>((*steps)[i]) * unitsPerStep;
  return depth;
}

}  // namespace image_codecs

Bytes encodePng(const ImageU8& image) {
  CHECK((image.channels == 1 || image.channels == 3 || image.channels == 4));
  CHECK(!image.empty());
  const Codec codec(spng_ctx_new(SPNG_CTX_ENCODER), spng_ctx_free);
  CHECK(codec != nullptr);
  spng_set_option(codec.get(), SPNG_ENCODE_TO_BUFFER, 1);
  spng_set_option(codec.get(), SPNG_IMG_COMPRESSION_LEVEL, 5);
  spng_ihdr header{};
  header.width = static_cast<uint32_t>(image.width);
  header.height = static_cast<uint32_t>(image.height);
  header.bit_depth = 8;
  header.color_type = image.channels == 1   ? SPNG_COLOR_TYPE_GRAYSCALE
                      : image.channels == 3 ? SPNG_COLOR_TYPE_TRUECOLOR
                                            : SPNG_COLOR_TYPE_TRUECOLOR_ALPHA;
  CHECK(spng_set_ihdr(codec.get(), &header) == 0);
  CHECK(spng_encode_image(codec.get(), image.pixels.data(), image.pixels.size(), SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE) ==
        0);
  size_t size = 0;
  int status = 0;
  void* buffer = spng_get_png_buffer(codec.get(), &size, &status);
  CHECK(buffer != nullptr);
  const auto* start = static_cast<const std::byte*>(buffer);
  Bytes bytes(start, start + size);
  std::free(buffer);
  return bytes;
}

}  // namespace tessera
