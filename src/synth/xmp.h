// The XMP packet of a drone photo: gimbal angles and heights, with DJI's names. Source: DJI's namespace
// http://www.dji.com/drone-dji/1.0/, and XMP specification part 3 (2016), 1.1.3, for its place in a JPEG.
#pragma once

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

struct XmpFields {
  GpsFix gps;
  Mat3d worldFromCamera = Mat3d::Identity();  // world axes: east, north, up
};

// Returns the segment, which begins with its marker, ready to stand in a JPEG.
Bytes encodeXmpSegment(const XmpFields& fields);

// Returns the JPEG with the segment after those that it begins with.
Bytes withSegment(std::span<const std::byte> jpeg, std::span<const std::byte> segment);

}  // namespace tessera
