// Where each ray's samples stand, from how many it has.
#pragma once

#include <cstdint>

namespace tessera::cpu {

// Counts in offsets[1 .. rays] to running ends; what no longer fits `capacity` becomes empty, and so does all after it.
// Returns how many fit.
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
