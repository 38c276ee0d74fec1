// Generates the scene that is committed in tests/golden/volume. The marching step of its merged level is half a texel.
#pragma once

#include <array>
#include <nlohmann/json.hpp>

#include "golden/golden_landscape.h"
#include "representations/volume/content/volume_content.h"

namespace tessera::golden {

Scene<VolumeContent> makeVolumeScene();

// The checksums that every reader, in C++ and in a browser, must compute: sums of integers below 2^53.
// docs/tile-format.md, section 12.
struct VolumeSums {
  uint64_t stored = 0, firstStored = 0, occupied = 0, distances = 0;
  ByteSums voxels;
  std::array<ByteSums, 3> planes;
};
VolumeSums computeSums(const VolumePart& part);
nlohmann::ordered_json toJson(const VolumeSums& sums);

}  // namespace tessera::golden
