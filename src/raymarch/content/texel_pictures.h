// Texels of eight bytes as pictures and back. Each picture holds up to three of the eight as red, green, blue.
// docs/tile-format.md, section 6.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/image.h"
#include "raymarch/content/content_part.h"
#include "raymarch/content/occupancy_pyramid.h"

namespace tessera {

inline constexpr size_t kTexelBytes = 8;
inline constexpr size_t kTexelPictures = 3;
// Diffuse colour; the first three features; density and the last feature, with blue 0. What belongs together compresses
// together: 6 % smaller than eight grey pictures (512² texels made from a photo), within 3 % of every other grouping.
inline constexpr int kNoAttribute = -1;
inline constexpr std::array<std::array<int, 3>, kTexelPictures> kAttributesOfPicture = {
    {{1, 2, 3}, {4, 5, 6}, {0, 7, kNoAttribute}}};

struct PictureSize {
  uint32_t width = 0, height = 0;
};

// Macroblocks are tiles of 27 × 27 pixels, as many beside one another as the
// least number whose square is enough, row after row: slice z of a block lies at (z % 3, z / 3) · 9 in its tile.
PictureSize sizeOfMacroblocks(uint32_t stored);
// Rows of 256 pixels, or of the least power of two that keeps the height within what WebP allows.
PictureSize sizeOfList(uint64_t pixels);
// One bit a cell, eight to a byte (number n is bit n % 8 of byte n / 8), a byte a pixel with red = green = blue, as a
// list. What is left over is 0.
PictureSize sizeOfBits(uint64_t bits);

using TexelPictures = std::array<ImageU8, kTexelPictures>;
// Texel after texel, row after row; pixels that are left over are 0.
TexelPictures picturesOfTexels(std::span<const uint8_t> texels, const PictureSize& size);
TexelPictures picturesOfMacroblocks(std::span<const uint8_t> voxels, uint32_t stored);
ImageU8 pictureOfBits(const OccupancyBits& bits);

// Sizes are those above. False where a picture holds what the form has no place for: it would not come back.
bool takeTexels(const ImageU8& picture, size_t which, std::span<uint8_t> texels);
bool takeMacroblocks(const ImageU8& picture, size_t which, uint32_t stored, std::span<uint8_t> voxels);
bool takeBits(const ImageU8& picture, OccupancyBits& bits);

}  // namespace tessera
