// Settings, counters and results of ray marching, whatever the representation.
#pragma once

#include "render/drawer.h"

namespace tessera {

struct MarchSettings {
  bool skipEmptySpace = true;
  float minTransmittance = 1.0f / 255;  // rays end below this transmittance; 0: never
  // Whether to skip empty space with a grid of distances where a content also has another structure for it: the levels
  // of its occupancy pyramid.
  bool useDistances = true;
};

using MarchCounts = DrawCounts;

// The samples of one content along one ray, composited: Σ w c, Σ w f, Π (1 - α) and Σ w t, with t in scene units.
struct ContentComposite {
  static constexpr int kValues = 7;  // diffuse r g b, 4 features
  float values[kValues] = {};
  float transmittance = 1;
  float depth = 0;
};

}  // namespace tessera
