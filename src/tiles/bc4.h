// BC4 (unsigned), the block compression of one channel that GPUs decode: 4×4 texels of 8 bits in 8 bytes. BC5 is two
// such blocks.
//
// Byte 0 is e0, byte 1 is e1, and bytes 2 to 7 hold sixteen indices of 3 bits, least significant first, rows first. If
// e0 > e1, the palette is e0, e1, and (k e0 + (7 - k) e1) / 7 for k = 6 to 1; otherwise e0, e1,
// (k e0 + (5 - k) e1) / 5 for k = 4 to 1, 0 and 255.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace tessera {

using Bc4Block = std::array<uint8_t, 8>;
using Bc4Texels = std::array<uint8_t, 16>;  // rows first

// Returns the palette without rounding, 0 to 255. Decoders of GPUs may round to 8 bits or more.
std::array<float, 8> bc4Palette(uint8_t e0, uint8_t e1);
// Returns the texels without rounding.
std::array<float, 16> decodeBc4(const Bc4Block& block);
// Returns one texel of a block of 8 bytes without rounding; `texel`: 0 to 15, rows first.
float decodeBc4Texel(const uint8_t* block, uint32_t texel);

enum class Bc4Effort {
  fast,        // the range of the texels as end points
  exhaustive,  // the pair of end points with the least sum of squared errors
};
// A texel gets the nearest entry of the palette, the first of equally near ones.
Bc4Block encodeBc4(const Bc4Texels& texels, Bc4Effort effort);

// Encodes an image of one channel, whose sides are multiples of 4: blocks row by row.
std::vector<uint8_t> encodeBc4Image(std::span<const uint8_t> texels, uint32_t width, uint32_t height, Bc4Effort effort);
// Decodes such blocks to [height][width] texels, rounded to the nearest byte.
std::vector<uint8_t> decodeBc4Image(std::span<const uint8_t> blocks, uint32_t width, uint32_t height);

}  // namespace tessera
