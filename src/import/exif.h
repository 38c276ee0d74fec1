// Where a photo was taken and which way the camera hung, from its EXIF (libexif) and from the XMP that drones add.
// Source: EXIF 2.3; DJI's XMP namespace http://www.dji.com/drone-dji/1.0/.
#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

// Degrees, north-east-down, intrinsic Z-Y-X: yaw clockwise from north, pitch 0 at the horizon and -90 straight down.
struct GimbalAngles {
  double yaw = 0, pitch = 0, roll = 0;
};

struct PhotoTags {
  std::optional<GpsFix> gps;
  std::optional<GimbalAngles> gimbal;
};

// Untrusted bytes of a whole JPEG file (or its first part). Tags that are not there, or make no sense, are empty.
PhotoTags decodePhotoTags(std::span<const std::byte> jpeg);

// The part of it that is XMP: attributes (drone-dji:GpsLatitude="+1.5") and elements (<drone-dji:GpsLatitude>) alike.
struct XmpTags {
  std::optional<double> latitude, longitude, absoluteAltitude, relativeAltitude;
  std::optional<double> gimbalYaw, gimbalPitch, gimbalRoll;
};
XmpTags decodeXmp(std::string_view xmp);

}  // namespace tessera
