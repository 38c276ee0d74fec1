// The EXIF block of a drone photo: camera, lens, time and GPS. Source: EXIF 2.32 (TIFF 6.0 directories).
#pragma once

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

struct ExifFields {
  GpsFix gps;
  double focalLength35 = 28;  // millimetres on a 36 mm wide picture
  double exposure = 0;        // log2, moves the exposure time away from 1/500 s
  double seconds = 0;         // since take-off at 2024-06-21 10:00:00
};

// Begins with "Exif\0\0", ready for a JPEG's APP1 segment.
Bytes encodeExif(const ExifFields& fields);

}  // namespace tessera
