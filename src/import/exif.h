// The GPS position of a photo, from its EXIF (libexif) or from the XMP that drones add, and the gimbal angles from that
// XMP. The orientation tag of EXIF is not read: pixels are used as they are stored (see base/image_io.h).
// Source: EXIF 2.3; DJI's XMP namespace http://www.dji.com/drone-dji/1.0/.
#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

// Orientation of a camera gimbal: degrees, north-east-down, intrinsic Z-Y-X; yaw is clockwise from north, pitch is 0 at
// the horizon and -90 straight down.
struct GimbalAngles {
  double yaw = 0, pitch = 0, roll = 0;
};

struct PhotoTags {
  std::optional<GpsFix> gps;
  std::optional<GimbalAngles> gimbal;
};

// Decodes the tags of a JPEG file from its untrusted bytes (all of them, or the first part). Missing and implausible
// tags are empty.
PhotoTags decodePhotoTags(std::span<const std::byte> jpeg);

// The tags of the XMP packet, given as attributes (drone-dji:GpsLatitude="+1.5") or as elements
// (<drone-dji:GpsLatitude>).
struct XmpTags {
  std::optional<double> latitude, longitude, absoluteAltitude, relativeAltitude;
  std::optional<double> gimbalYaw, gimbalPitch, gimbalRoll;
};
XmpTags decodeXmp(std::string_view xmp);

}  // namespace tessera
