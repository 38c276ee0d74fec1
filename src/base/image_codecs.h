// The codecs behind image_io.h, one source file per format. They give the same guarantees: they accept untrusted bytes
// and throw no exceptions.
#pragma once

#include "base/image_io.h"

namespace tessera::image_codecs {

bool isJpeg(std::span<const std::byte> bytes);
bool isPng(std::span<const std::byte> bytes);
bool isExr(std::span<const std::byte> bytes);

std::optional<ImageInfo> probeJpeg(std::span<const std::byte> bytes);
std::optional<ImageInfo> probePng(std::span<const std::byte> bytes);
std::optional<ImageInfo> probeExr(std::span<const std::byte> bytes);

std::optional<DecodedImage> decodeJpeg(std::span<const std::byte> bytes, const DecodeLimits& limits);
std::optional<DecodedImage> decodePng(std::span<const std::byte> bytes, const DecodeLimits& limits);
std::optional<ImageF> decodeExrDepth(std::span<const std::byte> bytes, const DecodeLimits& limits);
std::optional<ImageF> decodePngDepth(std::span<const std::byte> bytes, float unitsPerStep, const DecodeLimits& limits);

// Returns false if the size in the header is above the limit, or if so few bytes cannot encode that many pixels even in
// a single flat colour.
bool isPlausible(int64_t width, int64_t height, size_t bytes, const DecodeLimits& limits);

}  // namespace tessera::image_codecs
