// A city of our own: procedural, seeded, ray traced, with everything known exactly.
#pragma once

#include <cstdint>
#include <vector>

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

struct CityOptions {
  int blocksX = 2, blocksY = 2;
  int photos = 0;                 // 0: enough for the size of the city
  int width = 400, height = 300;  // of a photo, pixels
  uint64_t seed = 1;
  std::vector<double> altitudes{60, 120};  // of the flights, metres above the ground
  bool traffic = false;                    // cars that move between photos, with masks
  double exposureJitter = 0;               // standard deviation of the photos' log2 gain
  int samplesPerPixel = 6;                 // more is slower and cleaner; uneven pixels get three times as many
  int holdoutEvery = 8;                    // photos 0, n, 2n, … are the test split; 0 for none
  bool pinhole = false;                    // an ideal lens instead of a mildly distorted one
  int threads = 0;                         // 0: all
};

// How many photos `photos = 0` stands for.
int photosForCity(int blocksX, int blocksY);

// Writes photos (JPEG with EXIF GPS), depths, masks and, last, transforms.json below `out`, and returns the capture.
// Photos that an earlier run with the same options finished are kept. The files' bytes are a function of the options
// alone, not of the number of threads. Throws Error when `out` holds a city of other options.
Capture synthesiseCity(const fs::path& out, const CityOptions& options);

}  // namespace tessera
