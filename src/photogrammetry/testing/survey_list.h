// Shared by the tests of src/photogrammetry: lists of photos of a survey, which are not on disk.
#pragma once

#include "photogrammetry/photo_list.h"

namespace tessera {

inline constexpr double kMetresPerDegree = 111320;

// A photo of a survey near the equator, where a degree of longitude is as long as one of latitude.
inline ListedPhoto photoAt(double east, double north, double height, const GimbalAngles& gimbal, int flight,
                           double seconds) {
  ListedPhoto photo;
  photo.flight = flight;
  photo.tags.gps = GpsFix{north / kMetresPerDegree, east / kMetresPerDegree, 100 + height, height};
  photo.tags.gimbal = gimbal;
  photo.tags.takenAt = seconds;
  return photo;
}

// Lines from west to east, `step` metres apart, at 60 m with a picture of about 76 × 57 m on the ground.
inline PhotoList survey(int lines, int perLine, double step) {
  PhotoList list;
  list.bodies = {{"camera", 800, 600, 628}};
  for (int row = 0; row < lines; ++row) {
    for (int k = 0; k < perLine; ++k) {
      const int column = row % 2 == 0 ? k : perLine - 1 - k;
      list.photos.push_back(photoAt(column * step, row * step, 60, {90, -90, 0}, 0, 3.0 * (row * perLine + k)));
    }
  }
  list.flights = 1;
  return list;
}

}  // namespace tessera
