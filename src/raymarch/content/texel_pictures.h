// Converts texels of eight bytes to pictures and back. Each picture stores up to three of the eight bytes as red, green
// and blue (docs/tile-format.md, section 6).
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
// The attributes of each picture: diffuse colour; the first three features; density and the last feature, with blue 0.
// Related attributes compress better together: 6 % smaller than eight grey pictures (512² texels made from a photo),
// and within 3 % of every other grouping.
inline constexpr int kNoAttribute = -1;
inline constexpr std::array<std::array<int, 3>, kTexelPictures> kAttributesOfPicture = {
    {{1, 2, 3}, {4, 5, 6}, {0, 7, kNoAttribute}}};

struct PictureSize {
  uint32_t width = 0, height = 0;
};

// Returns the size of a picture of macroblocks. Each is a tile of 27 × 27 pixels; slice z of a block lies at (z % 3, z
// / 3) · 9 in its tile. Tiles are stored row after row, with ceil(sqrt(stored)) tiles in a row.
PictureSize sizeOfMacroblocks(uint32_t stored);
// Returns the size of a picture for a list of pixels: rows of 256 pixels, or of the smallest power of two above that
// keeps the height within the limit of WebP.
PictureSize sizeOfList(uint64_t pixels);
// Returns the size of a picture of bits: eight cells to a byte (cell n is bit n % 8 of byte n / 8), one byte to a pixel
// with red = green = blue, arranged as a list. Unused bits are 0.
PictureSize sizeOfBits(uint64_t bits);

using TexelPictures = std::array<ImageU8, kTexelPictures>;
// Store texels in order, row after row; unused pixels are 0.
TexelPictures picturesOfTexels(std::span<const uint8_t> texels, const PictureSize& size);
TexelPictures picturesOfMacroblocks(std::span<const uint8_t> voxels, uint32_t stored);
ImageU8 pictureOfBits(const OccupancyBits& bits);

// Read pictures of the sizes above. They return false if a picture contains anything that the format has no meaning
// for, and that encoding would therefore not reproduce.
bool takeTexels(const ImageU8& picture, size_t which, std::span<uint8_t> texels);
bool takeMacroblocks(const ImageU8& picture, size_t which, uint32_t stored, std::span<uint8_t> voxels);
bool takeBits(const ImageU8& picture, OccupancyBits& bits);

}  // namespace tessera
