// Reads the few relevant values of a drone's XMP without an XML parser: a name, then = and a quoted value, or > and
// the text up to the next <.
#include <array>
#include <charconv>
#include <cmath>

#include "import/exif.h"

namespace tessera {
namespace {

constexpr std::string_view kBlank = " \t\r\n";

bool isNameCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' || c == '.';
}

std::optional<double> numberIn(std::string_view text) {
  const size_t begin = text.find_first_not_of(kBlank);
  if (begin == text.npos) return std::nullopt;
  text.remove_prefix(begin);
  if (text[0] == '+') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const std::string_view rest = text.substr(static_cast<size_t>(end - text.data()));
  if (error != std::errc() || !std::isfinite(value) || rest.find_first_not_of(kBlank) != rest.npos) return std::nullopt;
  return value;
}

// Calls accept(value) with the texts of "prefix:name" for any prefix, one after another, until it returns true.
template <class Accept>
void visitValues(std::string_view xmp, std::string_view name, const Accept& accept) {
  for (size_t at = xmp.find(name); at != xmp.npos; at = xmp.find(name, at + 1)) {
    if (at == 0 || xmp[at - 1] != ':') continue;
    std::string_view rest = xmp.substr(at + name.size());
    if (!rest.empty() && isNameCharacter(rest[0])) continue;  // a prefix of a longer name
    const size_t sign = rest.find_first_not_of(kBlank);
    if (sign == rest.npos) return;
    rest.remove_prefix(sign);
    std::string_view value;
    if (rest[0] == '=') {
      const size_t open = rest.find_first_not_of(kBlank, 1);
      if (open == rest.npos || (rest[open] != '"' && rest[open] != '\'')) continue;
      const size_t close = rest.find(rest[open], open + 1);
      if (close == rest.npos) return;
      value = rest.substr(open + 1, close - open - 1);
    } else if (rest[0] == '>') {
      value = rest.substr(1, rest.find('<') == rest.npos ? 0 : rest.find('<') - 1);
    } else {
      continue;
    }
    if (accept(value)) return;
  }
}

std::optional<double> find(std::string_view xmp, std::string_view name) {
  std::optional<double> number;
  visitValues(xmp, name, [&number](std::string_view value) { return (number = numberIn(value)).has_value(); });
  return number;
}

}  // namespace

XmpTags decodeXmp(std::string_view xmp) {
  XmpTags tags;
  tags.latitude = find(xmp, "GpsLatitude");
  tags.longitude = find(xmp, "GpsLongitude");
  if (!tags.longitude) tags.longitude = find(xmp, "GpsLongtitude");  // sic: older firmware
  tags.absoluteAltitude = find(xmp, "AbsoluteAltitude");
  tags.relativeAltitude = find(xmp, "RelativeAltitude");
  tags.gimbalYaw = find(xmp, "GimbalYawDegree");
  tags.gimbalPitch = find(xmp, "GimbalPitchDegree");
  tags.gimbalRoll = find(xmp, "GimbalRollDegree");
  visitValues(xmp, "ImageSource", [&tags](std::string_view value) {
    tags.isInfrared = value.find("Infrared") != value.npos;
    return true;
  });
  visitValues(xmp, "ProjectionType", [&tags](std::string_view value) {
    tags.isPanorama = value == "equirectangular" || value == "cylindrical";
    return true;
  });
  return tags;
}

}  // namespace tessera
