// What marching has in common, whatever the representation.
#pragma once

#include <cstdint>

namespace tessera {

struct MarchSettings {
  bool skipEmptySpace = true;
  float minTransmittance = 1.0f / 255;  // rays end where less than this would be seen; 0: never
  bool useDistances = true;             // of `hash`, to skip by: beside the levels of the occupancy
};

// Adds up over calls.
struct MarchCounts {
  uint64_t steps = 0;    // places that were looked at
  uint64_t samples = 0;  // of them evaluated
};

// One content along one ray: Σ w c, Σ w f, Π (1 - α) and Σ w t of its samples, t in scene units.
struct ContentComposite {
  static constexpr int kValues = 7;  // diffuse r g b, 4 features
  float values[kValues] = {};
  float transmittance = 1;
  float depth = 0;
};

}  // namespace tessera
