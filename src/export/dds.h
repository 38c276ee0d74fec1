// DDS, the container of textures that GPUs read as they are.
// Source: Microsoft, "Programming guide for DDS" (DDS_HEADER and DDS_HEADER_DXT10).
#pragma once

#include <cstdint>
#include <span>

#include "base/file.h"

namespace tessera {

// Returns a file of one BC4 (unsigned) texture without mipmaps. `blocks`: those of tiles/bc4.h, row by row. `width` and
// `height`: multiples of 4, in texels.
Bytes encodeBc4Dds(std::span<const uint8_t> blocks, uint32_t width, uint32_t height);

}  // namespace tessera
