// Rays through the golden scenes, and their expected results by the definition (docs/tile-format.md, sections 4 and 6
// to 8) in double precision. Renderers in every language are tested against them.
#pragma once

#include <array>
#include <vector>

#include "golden/golden_landscape.h"
#include "representations/hash/content/hash_content.h"
#include "representations/mesh/content/mesh_content.h"
#include "representations/volume/content/volume_content.h"

namespace tessera::golden {

struct ExpectedRay {
  uint32_t level = 0;  // the tiles of this level are drawn, with the background block
  Vec3d origin = Vec3d::Zero(), direction = Vec3d::UnitZ();  // scene frame; the direction has length 1
  // Premultiplied, without the scene's background colour; the distance is in scene units.
  std::array<double, 3> colour = {0, 0, 0};
  double opacity = 0, distance = 0;
};

// Rays from outside the box, from inside, past it, closely over what stands in it, and along its axes.
std::vector<ExpectedRay> makeRays(const Scene<VolumeContent>& scene);
std::vector<ExpectedRay> makeRays(const Scene<HashContent>& scene);
// Without rays that pass so closely by an edge of a triangle that rounding decides what they hit.
std::vector<ExpectedRay> makeRays(const Scene<MeshContent>& scene);

}  // namespace tessera::golden
