// Lossless WebP with red, green and blue and without an alpha channel (codecs and browsers may alter colours under
// alpha): the format in which texels are stored. Source: RFC 9649.
#pragma once

#include <optional>
#include <span>

#include "base/file.h"
#include "base/image.h"

namespace tessera {

inline constexpr int kLargestLosslessSide = 16383;

// Encodes an image of 3 channels, with sides from 1 to kLargestLosslessSide pixels. `effort`: 0 to 9; 9 gives the
// smallest file and is slow. The same version of the library gives the same bytes for the same image.
Bytes encodeLossless(const ImageU8& image, int effort = 6);

// Decodes untrusted bytes. Returns nothing unless they are a single still, lossless image without alpha of exactly this
// size; sizes are compared before memory for pixels is allocated.
std::optional<ImageU8> decodeLossless(std::span<const std::byte> bytes, int width, int height);

}  // namespace tessera
