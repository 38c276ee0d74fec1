// A synthetic city: procedural, seeded and ray traced, with exact ground truth.
#pragma once

#include <cstdint>
#include <vector>

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

struct CityOptions {
  int blocksX = 2, blocksY = 2;
  int photos = 0;                 // 0: enough for the size of the city, or as many as `overlap` takes
  double overlap = 0;             // 0: flights of that many photos; else surveys with this overlap (FlightOptions)
  int width = 400, height = 300;  // of a photo, pixels
  uint64_t seed = 1;
  std::vector<double> altitudes{60, 120};  // of the flights, metres above the ground
  bool traffic = false;                    // whether cars move between photos; they are masked
  double exposureJitter = 0;               // standard deviation of the photos' log2 gain
  int samplesPerPixel = 6;                 // more is slower and less noisy; uneven pixels get three times as many
  int holdoutEvery = 8;                    // photos 0, n, 2n, … form the test split; 0: none
  bool pinhole = false;                    // whether the lens is ideal instead of mildly distorted
  // Errors of the GPS fixes: standard deviations of latitude and longitude, and of altitude, in metres; and how many
  // metres the heights of the first, second, … flight are too high. Poses remain exact.
  double gpsNoise = 0, gpsHeightNoise = 0;
  std::vector<double> heightOffsets;
  bool exif = true;  // whether photos have EXIF and XMP
  int threads = 0;   // 0: all of the machine
};

// Returns the number of photos that `photos = 0` stands for.
int photosForCity(int blocksX, int blocksY);

// Writes photos (JPEG with GPS, exposure and gimbal angles in EXIF and XMP), depths, masks and, last, transforms.json
// to `out`, and returns the capture. Photos that an earlier run with the same options finished are kept. The bytes of
// the files are a function of the options alone, not of the number of threads. Throws Error if `out` holds a city with
// other options.
Capture synthesiseCity(const fs::path& out, const CityOptions& options);

}  // namespace tessera
