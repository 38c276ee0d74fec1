// The scene that is committed in tests/golden/volume, as a function; its merged level has steps of half a texel.
#pragma once

#include "golden/golden_landscape.h"
#include "tiles/volume_content.h"

namespace tessera::golden {

Scene<VolumeContent> makeVolumeScene();

// What every reader has to come to, in C++ and in a browser; sums of whole numbers below 2^53. docs/tile-format.md,
// section 11.
struct VolumeSums {
  uint64_t stored = 0, firstStored = 0, occupied = 0, distances = 0;
  uint64_t voxels = 0, voxelsOrdered = 0;
  uint64_t planes[3] = {0, 0, 0}, planesOrdered[3] = {0, 0, 0};

  bool operator==(const VolumeSums&) const = default;
};
VolumeSums sumsOf(const VolumePart& part);

}  // namespace tessera::golden
