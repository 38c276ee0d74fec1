#include "raymarch/content/texel_pictures.h"

#include <algorithm>

#include "base/check.h"
#include "tiles/lossless_image.h"

namespace tessera {
namespace {

constexpr uint32_t kEdge = ContentPart::kStoredEdge, kSlicesBeside = 3, kTile = kEdge * kSlicesBeside;

void putTexel(const uint8_t* texel, size_t which, uint8_t* pixel) {
  for (size_t c = 0; c < 3; ++c) {
    const int attribute = kAttributesOfPicture[which][c];
    pixel[c] = attribute == kNoAttribute ? 0 : texel[attribute];
  }
}

bool takeTexel(const uint8_t* pixel, size_t which, uint8_t* texel) {
  for (size_t c = 0; c < 3; ++c) {
    const int attribute = kAttributesOfPicture[which][c];
    if (attribute != kNoAttribute) {
      texel[attribute] = pixel[c];
    } else if (pixel[c] != 0) {
      return false;
    }
  }
  return true;
}

uint32_t tilesBeside(uint32_t stored) {
  uint32_t columns = 0;
  while (uint64_t{columns} * columns < stored) ++columns;
  return columns;
}

// Calls visit(texel, x, y) for the texels in the order of macroblocks, each with its pixel.
template <class Visit>
void forEachVoxel(uint32_t stored, const Visit& visit) {
  const uint32_t columns = tilesBeside(stored);
  size_t texel = 0;
  for (uint32_t block = 0; block < stored; ++block) {
    for (uint32_t z = 0; z < kEdge; ++z) {
      const uint32_t left = block % columns * kTile + z % kSlicesBeside * kEdge;
      const uint32_t top = block / columns * kTile + z / kSlicesBeside * kEdge;
      for (uint32_t y = 0; y < kEdge; ++y) {
        for (uint32_t x = 0; x < kEdge; ++x) visit(texel++, static_cast<int>(left + x), static_cast<int>(top + y));
      }
    }
  }
}

ImageU8 blank(const PictureSize& size) {
  return ImageU8(static_cast<int>(size.width), static_cast<int>(size.height), 3);
}

}  // namespace

PictureSize sizeOfMacroblocks(uint32_t stored) {
  const uint32_t columns = tilesBeside(stored);
  return {columns * kTile, columns == 0 ? 0 : (stored + columns - 1) / columns * kTile};
}

PictureSize sizeOfList(uint64_t pixels) {
  uint64_t width = 256;
  while ((pixels + width - 1) / width > kLargestLosslessSide) width *= 2;
  return {static_cast<uint32_t>(width), static_cast<uint32_t>((pixels + width - 1) / width)};
}

PictureSize sizeOfBits(uint64_t bits) {
  return sizeOfList((bits + 7) / 8);
}

TexelPictures picturesOfTexels(std::span<const uint8_t> texels, const PictureSize& size) {
  TexelPictures pictures;
  const size_t count = texels.size() / kTexelBytes;
  for (size_t which = 0; which < kTexelPictures; ++which) {
    pictures[which] = blank(size);
    CHECK(count <= pictures[which].pixelCount());
    for (size_t i = 0; i < count; ++i) {
      putTexel(texels.data() + i * kTexelBytes, which, pictures[which].pixels.data() + 3 * i);
    }
  }
  return pictures;
}

TexelPictures picturesOfMacroblocks(std::span<const uint8_t> voxels, uint32_t stored) {
  CHECK(voxels.size() == size_t{stored} * ContentPart::kStoredTexels * kTexelBytes);
  TexelPictures pictures;
  for (size_t which = 0; which < kTexelPictures; ++which) {
    pictures[which] = blank(sizeOfMacroblocks(stored));
    forEachVoxel(stored, [&](size_t texel, int x, int y) {
      putTexel(voxels.data() + texel * kTexelBytes, which, pictures[which].at(x, y));
    });
  }
  return pictures;
}

ImageU8 pictureOfBits(const OccupancyBits& bits) {
  ImageU8 picture = blank(sizeOfBits(bits.count()));
  for (size_t byte = 0; byte < (bits.count() + 7) / 8; ++byte) {
    const auto value = static_cast<uint8_t>(bits.words[byte / 8] >> (byte % 8 * 8));
    std::fill_n(picture.pixels.data() + 3 * byte, 3, value);
  }
  return picture;
}

bool takeTexels(const ImageU8& picture, size_t which, std::span<uint8_t> texels) {
  const size_t count = texels.size() / kTexelBytes;
  CHECK(count <= picture.pixelCount());
  for (size_t i = 0; i < count; ++i) {
    if (!takeTexel(picture.pixels.data() + 3 * i, which, texels.data() + i * kTexelBytes)) return false;
  }
  const auto rest = picture.pixels.begin() + static_cast<ptrdiff_t>(3 * count);
  return std::all_of(rest, picture.pixels.end(), [](uint8_t byte) { return byte == 0; });
}

bool takeMacroblocks(const ImageU8& picture, size_t which, uint32_t stored, std::span<uint8_t> voxels) {
  CHECK(voxels.size() == size_t{stored} * ContentPart::kStoredTexels * kTexelBytes);
  bool fits = true;
  forEachVoxel(stored, [&](size_t texel, int x, int y) {
    fits = takeTexel(picture.at(x, y), which, voxels.data() + texel * kTexelBytes) && fits;
  });
  return fits;
}

bool takeBits(const ImageU8& picture, OccupancyBits& bits) {
  const size_t count = bits.count();
  CHECK(picture.pixelCount() >= (count + 7) / 8);
  std::fill(bits.words.begin(), bits.words.end(), 0);
  for (size_t byte = 0; byte < picture.pixelCount(); ++byte) {
    const uint8_t* pixel = picture.pixels.data() + 3 * byte;
    if (pixel[0] != pixel[1] || pixel[0] != pixel[2]) return false;
    const uint8_t value = pixel[0];
    if (value == 0) continue;
    const size_t first = 8 * byte;
    if (first >= count || (count - first < 8 && value >> (count - first) != 0)) return false;
    bits.words[byte / 8] |= uint64_t{value} << (byte % 8 * 8);
  }
  return true;
}

}  // namespace tessera
