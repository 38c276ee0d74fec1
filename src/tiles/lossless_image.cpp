#include "tiles/lossless_image.h"

#include <webp/decode.h>
#include <webp/encode.h>

#include <memory>

#include "base/check.h"

namespace tessera {
namespace {

constexpr int kLossless = 2;  // the value of WebPBitstreamFeatures::format for lossless files

}  // namespace

Bytes encodeLossless(const ImageU8& image, int effort) {
  CHECK(image.channels == 3);
  CHECK(image.width >= 1);
  CHECK(image.height >= 1);
  CHECK(image.width <= kLargestLosslessSide);
  CHECK(image.height <= kLargestLosslessSide);
  WebPConfig config;
  CHECK(WebPConfigInit(&config));
  CHECK(WebPConfigLosslessPreset(&config, effort));
  config.exact = 1;
  config.thread_level = 0;
  WebPPicture picture;
  CHECK(WebPPictureInit(&picture));
  const std::unique_ptr<WebPPicture, decltype(&WebPPictureFree)> pictureOwner(&picture, WebPPictureFree);
  picture.use_argb = 1;
  picture.width = image.width;
  picture.height = image.height;
  CHECK(WebPPictureImportRGB(&picture, image.pixels.data(), 3 * image.width));
  WebPMemoryWriter writer;
  WebPMemoryWriterInit(&writer);
  const std::unique_ptr<WebPMemoryWriter, decltype(&WebPMemoryWriterClear)> writerOwner(&writer, WebPMemoryWriterClear);
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &writer;
  CHECK(WebPEncode(&config, &picture));
  const auto* start = reinterpret_cast<const std::byte*>(writer.mem);
  return Bytes(start, start + writer.size);
}

std::optional<ImageU8> decodeLossless(std::span<const std::byte> bytes, int width, int height) {
  const auto* start = reinterpret_cast<const uint8_t*>(bytes.data());
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(start, bytes.size(), &features) != VP8_STATUS_OK) return std::nullopt;
  if (features.width != width || features.height != height) return std::nullopt;
  if (features.has_alpha || features.has_animation || features.format != kLossless) return std::nullopt;
  ImageU8 image(width, height, 3);
  if (!WebPDecodeRGBInto(start, bytes.size(), image.pixels.data(), image.pixels.size(), 3 * width)) return std::nullopt;
  return image;
}

}  // namespace tessera
