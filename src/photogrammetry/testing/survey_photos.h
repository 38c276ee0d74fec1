// Shared by the tests of src/photogrammetry: photos of a flight, without content.
#pragma once

#include "base/image_io.h"
#include "synth/exif.h"
#include "synth/flights.h"
#include "synth/xmp.h"

namespace tessera {

struct SurveyPhoto {
  GpsFix gps{46.5, 6.5, 400, 60};
  double seconds = 0;
  double yaw = 0, pitch = -90;  // of the gimbal, degrees
};

inline void writeSurveyPhoto(const fs::path& file, const SurveyPhoto& photo) {
  constexpr double kRadiansPerDegree = 0.017453292519943295;
  const Bytes jpeg =
      encodeJpeg(ImageU8(8, 6, 3), 90, encodeExif({.gps = photo.gps, .focalLength35 = 28, .seconds = photo.seconds}));
  const Mat3d rotation = cameraRotation(photo.yaw * kRadiansPerDegree, -photo.pitch * kRadiansPerDegree);
  writeFileAtomically(file, withSegment(jpeg, encodeXmpSegment({photo.gps, rotation})));
}

}  // namespace tessera
