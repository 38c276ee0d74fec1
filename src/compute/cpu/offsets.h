// Converts the number of samples per ray to the offset of each ray's samples.
#pragma once

#include <cstdint>

namespace tessera::cpu {

// Converts the counts in offsets[1 .. rays] to running ends. The first ray whose samples exceed `capacity` becomes
// empty, and so do all rays after it. Returns the number of rays that fit.
inline uint32_t countsToOffsets(uint32_t* offsets, uint32_t rays, uint32_t capacity) {
  offsets[0] = 0;
  uint32_t fitting = 0;
  for (uint32_t ray = 0; ray < rays; ++ray) {
    const uint64_t end = static_cast<uint64_t>(offsets[ray]) + offsets[ray + 1];
    const bool fits = fitting == ray && end <= capacity;
    offsets[ray + 1] = fits ? static_cast<uint32_t>(end) : offsets[ray];
    fitting += fits;
  }
  return fitting;
}

}  // namespace tessera::cpu
