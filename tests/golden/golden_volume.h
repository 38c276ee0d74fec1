// The scene that is committed in tests/golden/volume, as a function: 2 × 1 blocks with smooth ground, a building each,
// one merged level with steps of half a texel, a surround. Arithmetic only, so that every machine makes the same bytes.
#pragma once

#include <map>
#include <string>

#include "tiles/tileset.h"
#include "tiles/volume_content.h"

namespace tessera::golden {

struct Scene {
  Tileset tileset;                                // contents without uris
  std::map<std::string, VolumeContent> contents;  // by name: "0_0", "1_0", "all", "surround"
};

Scene makeScene();

// What every reader has to come to, in C++ and in a browser; sums of whole numbers below 2^53. docs/tile-format.md,
// section 11.
struct Sums {
  uint64_t stored = 0, firstStored = 0, occupied = 0, distances = 0;
  uint64_t voxels = 0, voxelsOrdered = 0;
  uint64_t planes[3] = {0, 0, 0}, planesOrdered[3] = {0, 0, 0};

  bool operator==(const Sums&) const = default;
};
Sums sumsOf(const VolumePart& part);

}  // namespace tessera::golden
