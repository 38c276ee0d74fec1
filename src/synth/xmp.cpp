#include "synth/xmp.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <string>

#include "base/check.h"

namespace tessera {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180;

size_t bigEndian16(std::span<const std::byte> bytes, size_t at) {
  return std::to_integer<size_t>(bytes[at]) << 8 | std::to_integer<size_t>(bytes[at + 1]);
}

}  // namespace

Bytes encodeXmpSegment(const XmpFields& f) {
  const Vec3d right = f.worldFromCamera.col(0), down = f.worldFromCamera.col(1), forward = f.worldFromCamera.col(2);
  const double pitch = std::asin(std::clamp(forward.z(), -1.0, 1.0));
  // Straight down, the upper edge of the picture says where the camera faces, and roll is a part of the yaw.
  const bool isSteep = std::abs(forward.z()) > std::sin(80 * kRadiansPerDegree);
  const Vec3d ahead = isSteep ? Vec3d(-down) : forward;
  const double yaw = std::atan2(ahead.x(), ahead.y());
  const double roll = isSteep ? 0 : std::atan2(-right.z(), -down.z());
  const std::string text = fmt::format(
      "<?xpacket begin=\"\xef\xbb\xbf\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?>\n"
      "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\">\n"
      " <rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">\n"
      "  <rdf:Description rdf:about=\"\" xmlns:drone-dji=\"http://www.dji.com/drone-dji/1.0/\"\n"
      "   drone-dji:AbsoluteAltitude=\"{:+.2f}\"\n"
      "   drone-dji:RelativeAltitude=\"{:+.2f}\"\n"
      "   drone-dji:GimbalRollDegree=\"{:+.2f}\"\n"
      "   drone-dji:GimbalYawDegree=\"{:+.2f}\"\n"
      "   drone-dji:GimbalPitchDegree=\"{:+.2f}\"/>\n"
      " </rdf:RDF>\n"
      "</x:xmpmeta>\n"
      "<?xpacket end=\"w\"?>",
      f.gps.altitude, f.gps.relativeAltitude, roll / kRadiansPerDegree, yaw / kRadiansPerDegree,
      pitch / kRadiansPerDegree);
  constexpr std::string_view kName("http://ns.adobe.com/xap/1.0/\0", 29);
  const size_t length = 2 + kName.size() + text.size();
  CHECK(length <= 0xffffu);
  std::string segment{'\xff', '\xe1', static_cast<char>(length >> 8), static_cast<char>(length & 0xff)};
  segment += kName;
  segment += text;
  const auto bytes = std::as_bytes(std::span(segment));
  return {bytes.begin(), bytes.end()};
}

Bytes withSegment(std::span<const std::byte> jpeg, std::span<const std::byte> segment) {
  // JFIF's segment (0xe0) comes first, then EXIF's (0xe1).
  size_t at = 2;
  while (at + 4 <= jpeg.size() && jpeg[at] == std::byte{0xff} &&
         (jpeg[at + 1] == std::byte{0xe0} || jpeg[at + 1] == std::byte{0xe1})) {
    at += 2 + bigEndian16(jpeg, at + 2);
  }
  CHECK(at <= jpeg.size());
  Bytes whole(jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(at));
  whole.insert(whole.end(), segment.begin(), segment.end());
  whole.insert(whole.end(), jpeg.begin() + static_cast<std::ptrdiff_t>(at), jpeg.end());
  return whole;
}

}  // namespace tessera
