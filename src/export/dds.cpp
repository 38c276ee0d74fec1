#include "export/dds.h"

#include <array>
#include <cstring>

#include "base/check.h"

namespace tessera {
namespace {

constexpr uint32_t kDdsMagic = 0x20534444, kDx10 = 0x30315844;                // "DDS ", "DX10"
constexpr uint32_t kHeaderFlags = 0x1 | 0x2 | 0x4 | 0x1000 | 0x80000;         // caps, size, pixel format, linear size
constexpr uint32_t kFourCc = 0x4, kTexture = 0x1000;                          // of the pixel format, of the caps
constexpr uint32_t kBc4Unorm = 80, kTexture2d = 3;                            // DXGI_FORMAT, D3D10_RESOURCE_DIMENSION
constexpr size_t kHeaderWords = 1 + 31, kDx10Words = 5, kFirstOfFormat = 19;  // with the magic number

}  // namespace

Bytes encodeBc4Dds(std::span<const uint8_t> blocks, uint32_t width, uint32_t height) {
  CHECK((width % 4 == 0 && height % 4 == 0));
  CHECK(blocks.size() == size_t{width} * height / 2);
  std::array<uint32_t, kHeaderWords + kDx10Words> words{};
  words[0] = kDdsMagic;
  words[1] = 124;  // bytes of the header
  words[2] = kHeaderFlags;
  words[3] = height;
  words[4] = width;
  words[5] = static_cast<uint32_t>(blocks.size());
  words[7] = 1;                // level of mipmaps
  words[kFirstOfFormat] = 32;  // bytes of the pixel format
  words[kFirstOfFormat + 1] = kFourCc;
  words[kFirstOfFormat + 2] = kDx10;
  words[27] = kTexture;
  words[kHeaderWords] = kBc4Unorm;
  words[kHeaderWords + 1] = kTexture2d;
  words[kHeaderWords + 3] = 1;  // texture in the array
  Bytes file;
  for (const uint32_t word : words)
    for (int i = 0; i < 4; ++i) file.push_back(static_cast<std::byte>(word >> (8 * i)));
  const size_t start = file.size();
  file.resize(start + blocks.size());
  std::memcpy(file.data() + start, blocks.data(), blocks.size());
  return file;
}

}  // namespace tessera
