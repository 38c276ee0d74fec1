// Rays through the golden scenes, and what they come to by the definition (docs/tile-format.md, sections 4, 6 and 7),
// in double: what renderers in every language are held against.
#pragma once

#include <array>
#include <vector>

#include "golden/golden_landscape.h"
#include "representations/hash/content/hash_content.h"
#include "representations/volume/content/volume_content.h"

namespace tessera::golden {

struct ExpectedRay {
  uint32_t level = 0;                                        // the tiles of this level are drawn, and the surround
  Vec3d origin = Vec3d::Zero(), direction = Vec3d::UnitZ();  // scene frame; of length 1
  // Premultiplied, without the background; the distance in scene units.
  std::array<double, 3> colour = {0, 0, 0};
  double opacity = 0, distance = 0;
};

// From outside of the box, from inside, past it, just over what stands in it, and along its axes.
std::vector<ExpectedRay> makeRays(const Scene<VolumeContent>& scene);
std::vector<ExpectedRay> makeRays(const Scene<HashContent>& scene);

}  // namespace tessera::golden
