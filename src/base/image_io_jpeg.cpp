// JPEG through libjpeg-turbo. The library reports errors by longjmp, so a function that calls setjmp has no local
// objects with destructors: its callers own the buffers.
// jpeglib.h needs <cstdio> before it, and jerror.h after it.
// clang-format off
#include <csetjmp>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <jpeglib.h>
#include <jerror.h>
// clang-format on

#include "base/check.h"
#include "base/image_codecs.h"

namespace tessera {
namespace {

constexpr int kMaximumScans = 200;  // each scan of a progressive file costs a pass over the whole image

struct Failure : jpeg_error_mgr {
  std::jmp_buf target;
  bool truncated = false;
};

[[noreturn]] void leave(j_common_ptr codec) {
  std::longjmp(static_cast<Failure*>(codec->err)->target, 1);
}

void noteMessage(j_common_ptr codec, int level) {
  if (level >= 0) return;
  const int code = codec->err->msg_code;
  if (code == JWRN_JPEG_EOF || code == JWRN_HIT_MARKER) static_cast<Failure*>(codec->err)->truncated = true;
}

void installFailure(jpeg_error_mgr* base) {
  jpeg_std_error(base);
  base->error_exit = leave;
  base->emit_message = noteMessage;
  base->output_message = [](j_common_ptr) {};
}

void limitScans(j_common_ptr codec) {
  if (codec->is_decompressor && reinterpret_cast<j_decompress_ptr>(codec)->input_scan_number > kMaximumScans) {
    leave(codec);
  }
}

// Adobe stores ink values inverted: 255 is no ink.
void rgbFromCmyk(const uint8_t* cmyk, uint8_t* rgb, int pixels, bool inverted) {
  for (int i = 0; i < pixels; ++i, cmyk += 4, rgb += 3) {
    const int white = inverted ? cmyk[3] : 255 - cmyk[3];
    for (int c = 0; c < 3; ++c)
      rgb[c] = static_cast<uint8_t>(((inverted ? cmyk[c] : 255 - cmyk[c]) * white + 127) / 255);
  }
}

bool decodeInto(std::span<const std::byte> bytes, const DecodeLimits& limits, DecodedImage& result,
                std::vector<uint8_t>& cmykLine) {
  jpeg_decompress_struct codec;
  Failure failure;
  jpeg_progress_mgr progress{};
  installFailure(&failure);
  codec.err = &failure;
  jpeg_create_decompress(&codec);
  if (setjmp(failure.target) != 0) {
    jpeg_destroy_decompress(&codec);
    return false;
  }
  progress.progress_monitor = limitScans;
  codec.progress = &progress;
  jpeg_mem_src(&codec, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&codec, TRUE);
  if (!image_codecs::isPlausible(codec.image_width, codec.image_height, bytes.size(), limits)) {
    leave(reinterpret_cast<j_common_ptr>(&codec));
  }
  const bool isInked = codec.jpeg_color_space == JCS_CMYK || codec.jpeg_color_space == JCS_YCCK;
  const bool isGrey = codec.jpeg_color_space == JCS_GRAYSCALE;
  codec.out_color_space = isInked ? JCS_CMYK : isGrey ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_start_decompress(&codec);
  const int width = static_cast<int>(codec.output_width);
  result.image = ImageU8(width, static_cast<int>(codec.output_height), isGrey ? 1 : 3);
  if (isInked) cmykLine.resize(static_cast<size_t>(width) * 4);
  while (codec.output_scanline < codec.output_height) {
    uint8_t* target = result.image.at(0, static_cast<int>(codec.output_scanline));
    JSAMPROW line = isInked ? cmykLine.data() : target;
    if (jpeg_read_scanlines(&codec, &line, 1) != 1) break;
    if (isInked) rgbFromCmyk(cmykLine.data(), target, width, codec.saw_Adobe_marker);
  }
  jpeg_finish_decompress(&codec);
  result.truncated = failure.truncated;
  jpeg_destroy_decompress(&codec);
  return true;
}

void encodeInto(const ImageU8& image, int quality, std::span<const std::byte> exif, unsigned char** buffer,
                unsigned long* size) {
  static constexpr unsigned char kExifName[6] = {'E', 'x', 'i', 'f', 0, 0};
  jpeg_compress_struct codec;
  Failure failure;
  installFailure(&failure);
  codec.err = &failure;
  jpeg_create_compress(&codec);
  if (setjmp(failure.target) != 0) CHECK(false);  // only for an image that the CHECKs should have rejected
  jpeg_mem_dest(&codec, buffer, size);
  codec.image_width = static_cast<JDIMENSION>(image.width);
  codec.image_height = static_cast<JDIMENSION>(image.height);
  codec.input_components = image.channels;
  codec.in_color_space = image.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&codec);
  jpeg_set_quality(&codec, quality, TRUE);
  for (int c = 0; c < codec.num_components; ++c)
    codec.comp_info[c].h_samp_factor = codec.comp_info[c].v_samp_factor = 1;
  jpeg_start_compress(&codec, TRUE);
  if (!exif.empty()) {
    const bool isNamed = exif.size() >= 6 && std::memcmp(exif.data(), kExifName, 6) == 0;
    jpeg_write_m_header(&codec, JPEG_APP0 + 1, static_cast<unsigned>(exif.size() + (isNamed ? 0 : 6)));
    for (int i = 0; !isNamed && i < 6; ++i) jpeg_write_m_byte(&codec, kExifName[i]);
    for (const std::byte value : exif) jpeg_write_m_byte(&codec, static_cast<int>(value));
  }
  while (codec.next_scanline < codec.image_height) {
    JSAMPROW line = const_cast<JSAMPROW>(image.at(0, static_cast<int>(codec.next_scanline)));
    jpeg_write_scanlines(&codec, &line, 1);
  }
  jpeg_finish_compress(&codec);
  jpeg_destroy_compress(&codec);
}

}  // namespace

namespace image_codecs {

bool isJpeg(std::span<const std::byte> bytes) {
  static constexpr unsigned char kStart[3] = {0xff, 0xd8, 0xff};
  return bytes.size() >= 3 && std::memcmp(bytes.data(), kStart, 3) == 0;
}

std::optional<ImageInfo> probeJpeg(std::span<const std::byte> bytes) {
  const auto at = [&](size_t i) { return static_cast<int>(bytes[i]); };
  for (size_t i = 2; i + 4 <= bytes.size();) {
    if (at(i) != 0xff) return std::nullopt;
    const int marker = at(i + 1);
    if (marker == 0xff) {  // padding
      ++i;
      continue;
    }
    if (marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8)) {  // markers without a length
      i += 2;
      continue;
    }
    if (marker == 0xda || marker == 0xd9) return std::nullopt;
    const bool isFrame = marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (isFrame) {
      if (i + 10 > bytes.size()) return std::nullopt;
      ImageInfo info;
      info.height = at(i + 5) << 8 | at(i + 6);
      info.width = at(i + 7) << 8 | at(i + 8);
      info.channels = at(i + 9) == 1 ? 1 : 3;
      info.format = ImageInfo::Format::jpeg;
      if (info.width < 1 || info.height < 1) return std::nullopt;
      return info;
    }
    i += 2 + static_cast<size_t>(at(i + 2) << 8 | at(i + 3));
  }
  return std::nullopt;
}

std::optional<DecodedImage> decodeJpeg(std::span<const std::byte> bytes, const DecodeLimits& limits) {
  DecodedImage result;
  std::vector<uint8_t> cmykLine;
  if (!decodeInto(bytes, limits, result, cmykLine)) return std::nullopt;
  return result;
}

}  // namespace image_codecs

Bytes encodeJpeg(const ImageU8& image, int quality, std::span<const std::byte> exif) {
  CHECK((image.channels == 1 || image.channels == 3));
  CHECK(image.width >= 1);
  CHECK(image.height >= 1);
  CHECK(image.width <= JPEG_MAX_DIMENSION);
  CHECK(image.height <= JPEG_MAX_DIMENSION);
  CHECK(exif.size() <= 65527u);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;
  encodeInto(image, quality, exif, &buffer, &size);
  const auto* start = reinterpret_cast<const std::byte*>(buffer);
  Bytes bytes(start, start + size);
  std::free(buffer);
  return bytes;
}

}  // namespace tessera
