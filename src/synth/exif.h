// The EXIF block of a drone photo: camera, lens, time and GPS. Source: EXIF 2.32 (TIFF 6.0 directories).
#pragma once

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

struct ExifFields {
  GpsFix gps;
  double focalLength35 = 28;  // millimetres, for a frame 36 mm wide
  double exposure = 0;        // log2; 0 is 1/500 s at ISO 100. What ISO does not add to it, the exposure time does
  int isoStops = 0;           // log2 of ISO / 100
  double seconds = 0;         // since take-off at 2024-06-21 10:00:00
};

// Returns a block that begins with "Exif\0\0", ready for a JPEG's APP1 segment.
Bytes encodeExif(const ExifFields& fields);

}  // namespace tessera
