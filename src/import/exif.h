// What a photo says of itself in its EXIF (libexif) and in the XMP that drones add: position, gimbal angles, camera,
// time and exposure. Pixels are used as they are stored (see base/image_io.h), whatever the orientation tag says.
// Source: EXIF 2.3; DJI's XMP namespace http://www.dji.com/drone-dji/1.0/.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "scene/capture.h"

namespace tessera {

// Orientation of a camera gimbal: degrees, north-east-down, intrinsic Z-Y-X; yaw is clockwise from north, pitch is 0 at
// the horizon and -90 straight down.
struct GimbalAngles {
  double yaw = 0, pitch = 0, roll = 0;
};

// The camera. Texts are empty and numbers 0 where the tags are missing.
struct CameraTags {
  std::string make, model, serial, lens;
  double focalLength = 0;          // millimetres
  double focalLength35 = 0;        // millimetres, of a camera with the same field of view and a picture of 36 × 24 mm
  double pixelsPerMillimetre = 0;  // of the sensor, along its width
  double recordedPixels = 0;       // of the longer side of the picture as the camera wrote it; it may be reduced since
  bool isThermal = false;          // an infrared camera beside the one for visible light, as the XMP says

  bool isPanorama = false;  // the picture is a map of the sphere around the camera, as the XMP says

  bool operator==(const CameraTags&) const = default;
};

struct ExposureTags {
  double seconds = 0, iso = 0, aperture = 0;  // 0: unknown
};

struct PhotoTags {
  std::optional<GpsFix> gps;
  std::optional<GimbalAngles> gimbal;
  CameraTags camera;
  ExposureTags exposure;
  std::optional<double> takenAt;  // seconds since 1970 by the camera's clock, whose time zone is unknown
  int orientation = 1;            // of EXIF, 1 to 8: how viewers turn the picture
};

// Returns the light that a picture collects in powers of two, up to a constant: log2(time · ISO / aperture²). An
// unknown aperture is that of a lens without one. Nothing if time or ISO is unknown.
std::optional<double> exposureStops(const ExposureTags& exposure);
// Returns these of several photos. If only some of them state an aperture (there are lenses that do not tell it), the
// exposures of the fewer ones are unknown, as they do not compare.
std::vector<std::optional<double>> comparableStops(std::span<const ExposureTags> exposures);

// Decodes the tags of a JPEG file from its untrusted bytes (all of them, or the first part). Missing and implausible
// tags are empty. The position and altitude of XMP, which has more digits, precede those of EXIF, unless the position
// of EXIF is another one: programs that correct positions write only there.
PhotoTags decodePhotoTags(std::span<const std::byte> jpeg);

// Returns the first part of a photo's file, which contains its tags and tells its size: 128 KiB, or up to 32 MiB of a
// JPEG whose tags need so much, such as depth maps and thermal pictures. Throws Error if the file cannot be read.
Bytes readPhotoHead(const fs::path& file);

// The tags of the XMP packet, given as attributes (drone-dji:GpsLatitude="+1.5") or as elements
// (<drone-dji:GpsLatitude>).
struct XmpTags {
  std::optional<double> latitude, longitude, absoluteAltitude, relativeAltitude;
  std::optional<double> gimbalYaw, gimbalPitch, gimbalRoll;
  bool isInfrared = false;  // ImageSource, of drones with several cameras
  bool isPanorama = false;  // ProjectionType of Google's GPano
};
XmpTags decodeXmp(std::string_view xmp);

}  // namespace tessera
