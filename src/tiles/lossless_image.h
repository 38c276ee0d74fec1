// WebP, lossless, red, green and blue without an alpha channel (under one, codecs and browsers alter colours): what
// texels are stored as. Source: RFC 9649.
#pragma once

#include <optional>
#include <span>

#include "base/file.h"
#include "base/image.h"

namespace tessera {

inline constexpr int kLargestLosslessSide = 16383;

// 3 channels, sides from 1 to kLargestLosslessSide. `effort` 0 to 9: 9 is the smallest file and slow. The same library
// gives the same bytes for the same picture.
Bytes encodeLossless(const ImageU8& image, int effort = 6);

// Untrusted bytes. Nothing unless they are one still, lossless picture without alpha of exactly this size; sizes are
// compared before anything is allocated for pixels.
std::optional<ImageU8> decodeLossless(std::span<const std::byte> bytes, int width, int height);

}  // namespace tessera
