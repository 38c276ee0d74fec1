// What marching has in common, whatever the representation.
#pragma once

#include "render/drawer.h"

namespace tessera {

struct MarchSettings {
  bool skipEmptySpace = true;
  float minTransmittance = 1.0f / 255;  // rays end where less than this would be seen; 0: never
  // Whether a grid of distances is used to skip by where contents have another way too: the levels of the occupancy.
  bool useDistances = true;
};

using MarchCounts = DrawCounts;

// One content along one ray: Σ w c, Σ w f, Π (1 - α) and Σ w t of its samples, t in scene units.
struct ContentComposite {
  static constexpr int kValues = 7;  // diffuse r g b, 4 features
  float values[kValues] = {};
  float transmittance = 1;
  float depth = 0;
};

}  // namespace tessera
