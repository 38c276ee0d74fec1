#include "import/exif.h"

#include <libexif/exif-data.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>

#include "base/image_io.h"

namespace tessera {
namespace {

struct DeleteExif {
  void operator()(ExifData* data) const { exif_data_unref(data); }
};

const ExifEntry* findEntry(const ExifData& data, ExifIfd directory, int tag, ExifFormat format,
                           unsigned long components = 1) {
  const ExifEntry* entry = exif_content_get_entry(data.ifd[directory], static_cast<ExifTag>(tag));
  const bool fits = entry != nullptr && entry->data != nullptr && entry->format == format &&
                    entry->components >= components && entry->size >= components * exif_format_get_size(format);
  return fits ? entry : nullptr;
}

const ExifEntry* gpsEntry(const ExifData& data, int tag, ExifFormat format, unsigned long components) {
  return findEntry(data, EXIF_IFD_GPS, tag, format, components);
}

// Returns nothing if the number is unknown: its denominator is 0.
std::optional<double> rational(const ExifData& data, const ExifEntry& entry, size_t index) {
  const ExifRational value =
      exif_get_rational(entry.data + 8 * index, exif_data_get_byte_order(const_cast<ExifData*>(&data)));
  if (value.denominator == 0) return std::nullopt;
  return static_cast<double>(value.numerator) / value.denominator;
}

// The same, but 0/0 is 0, as it is written for minutes and seconds that the numbers in front of them include.
std::optional<double> rationalOrZero(const ExifData& data, const ExifEntry& entry, size_t index) {
  const ExifRational value =
      exif_get_rational(entry.data + 8 * index, exif_data_get_byte_order(const_cast<ExifData*>(&data)));
  return value.numerator == 0 ? std::optional(0.0) : rational(data, entry, index);
}

// Degrees.
struct Angle {
  double value = 0;
  double step = 0;  // between the angles that can be stated in this way
};

// Reads an angle of degrees, minutes and seconds, negative if the reference letter is `negative`.
std::optional<Angle> readAngle(const ExifData& data, int tag, int referenceTag, char negative) {
  const ExifEntry* entry = gpsEntry(data, tag, EXIF_FORMAT_RATIONAL, 3);
  const ExifEntry* reference = gpsEntry(data, referenceTag, EXIF_FORMAT_ASCII, 1);
  if (entry == nullptr || reference == nullptr) return std::nullopt;
  const auto degrees = rational(data, *entry, 0), minutes = rationalOrZero(data, *entry, 1),
             seconds = rationalOrZero(data, *entry, 2);
  if (!degrees || !minutes || !seconds) return std::nullopt;
  const double value = *degrees + *minutes / 60 + *seconds / 3600;
  constexpr std::array kUnits = {1.0, 1.0 / 60, 1.0 / 3600};
  double step = 1;
  for (size_t i = 0; i < kUnits.size(); ++i) {
    const ExifRational number =
        exif_get_rational(entry->data + 8 * i, exif_data_get_byte_order(const_cast<ExifData*>(&data)));
    const bool isUsed = number.numerator > 0 || number.denominator > 1;
    if (isUsed) step = std::min(step, kUnits[i] / number.denominator);
  }
  return Angle{static_cast<char>(reference->data[0]) == negative ? -value : value, step};
}

struct ExifFix {
  GpsFix fix;
  double latitudeStep = 0, longitudeStep = 0;  // degrees
};

std::optional<ExifFix> readGpsFix(const ExifData& data) {
  const auto latitude = readAngle(data, EXIF_TAG_GPS_LATITUDE, EXIF_TAG_GPS_LATITUDE_REF, 'S');
  const auto longitude = readAngle(data, EXIF_TAG_GPS_LONGITUDE, EXIF_TAG_GPS_LONGITUDE_REF, 'W');
  if (!latitude || !longitude) return std::nullopt;
  GpsFix fix{.latitude = latitude->value, .longitude = longitude->value, .hasAltitude = false};
  if (const ExifEntry* altitude = gpsEntry(data, EXIF_TAG_GPS_ALTITUDE, EXIF_FORMAT_RATIONAL, 1)) {
    const ExifEntry* reference = gpsEntry(data, EXIF_TAG_GPS_ALTITUDE_REF, EXIF_FORMAT_BYTE, 1);
    const auto metres = rational(data, *altitude, 0);
    fix.altitude = metres.value_or(0);
    fix.hasAltitude = metres.has_value();
    if (reference != nullptr && reference->data[0] == 1) fix.altitude = -fix.altitude;
  }
  return ExifFix{fix, latitude->step, longitude->step};
}

// Returns a positive number, or 0.
double positive(const ExifData& data, ExifIfd directory, int tag) {
  double value = 0;
  if (const ExifEntry* entry = findEntry(data, directory, tag, EXIF_FORMAT_RATIONAL)) {
    value = rational(data, *entry, 0).value_or(0);
  } else if (const ExifEntry* whole = findEntry(data, directory, tag, EXIF_FORMAT_SHORT)) {
    value = exif_get_short(whole->data, exif_data_get_byte_order(const_cast<ExifData*>(&data)));
  } else if (const ExifEntry* wide = findEntry(data, directory, tag, EXIF_FORMAT_LONG)) {
    value = exif_get_long(wide->data, exif_data_get_byte_order(const_cast<ExifData*>(&data)));
  }
  return value > 0 && value < 1e9 ? value : 0;
}

// Returns a text without blanks at its ends and without control characters, of limited length.
std::string text(const ExifData& data, ExifIfd directory, int tag) {
  constexpr size_t kMaxLength = 100;
  const ExifEntry* entry = findEntry(data, directory, tag, EXIF_FORMAT_ASCII);
  if (entry == nullptr) return "";
  std::string value;
  for (size_t i = 0; i < entry->size && entry->data[i] != 0 && value.size() < kMaxLength; ++i)
    value += entry->data[i] >= 32 && entry->data[i] < 127 ? static_cast<char>(entry->data[i]) : '?';
  while (!value.empty() && value.back() == ' ') value.pop_back();
  return value.substr(std::min(value.find_first_not_of(' '), value.size()));
}

CameraTags readCamera(const ExifData& data) {
  // Tags of EXIF 2.3 that libexif 0.6 does not name.
  constexpr int kBodySerialNumber = 0xa431, kLensModel = 0xa434;
  CameraTags camera;
  camera.make = text(data, EXIF_IFD_0, EXIF_TAG_MAKE);
  camera.model = text(data, EXIF_IFD_0, EXIF_TAG_MODEL);
  camera.serial = text(data, EXIF_IFD_EXIF, kBodySerialNumber);
  camera.lens = text(data, EXIF_IFD_EXIF, kLensModel);
  camera.focalLength = positive(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH);
  camera.focalLength35 = positive(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  const double resolution = positive(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_PLANE_X_RESOLUTION);
  const double unit = positive(data, EXIF_IFD_EXIF, EXIF_TAG_FOCAL_PLANE_RESOLUTION_UNIT);
  camera.pixelsPerMillimetre = unit == 3 ? resolution / 10 : unit == 4 ? resolution : resolution / 25.4;
  camera.recordedPixels = std::max(positive(data, EXIF_IFD_EXIF, EXIF_TAG_PIXEL_X_DIMENSION),
                                   positive(data, EXIF_IFD_EXIF, EXIF_TAG_PIXEL_Y_DIMENSION));
  return camera;
}

// Reads "2024:06:21 11:02:05", and the fraction of the second.
std::optional<double> readTime(const ExifData& data) {
  std::string when = text(data, EXIF_IFD_EXIF, EXIF_TAG_DATE_TIME_ORIGINAL);
  if (when.empty()) when = text(data, EXIF_IFD_0, EXIF_TAG_DATE_TIME);
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, second = 0;
  if (std::sscanf(when.c_str(), "%4d:%2d:%2d %2d:%2d:%2d", &year, &month, &day, &hour, &minute, &second) != 6)
    return std::nullopt;
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (year < 1970 || !date.ok() || hour < 0 || hour > 23 || minute < 0 || minute > 59 || second < 0 || second > 60)
    return std::nullopt;
  const auto days = std::chrono::sys_days(date).time_since_epoch().count();
  const std::string fraction = text(data, EXIF_IFD_EXIF, EXIF_TAG_SUB_SEC_TIME_ORIGINAL);
  double part = 0, unit = 0.1;
  for (const char digit : fraction) {
    if (digit < '0' || digit > '9') break;
    part += unit * (digit - '0');
    unit /= 10;
  }
  return 86400.0 * static_cast<double>(days) + 3600 * hour + 60 * minute + second + part;
}

// Whether EXIF, which has fewer digits, states the place of the XMP. A place that another program has corrected stands
// in EXIF alone.
bool isSamePlace(const ExifFix& fix, double latitude, double longitude) {
  constexpr double kMetresPerDegree = 111320, kLeast = 0.5;  // metres
  const GpsFix& exif = fix.fix;
  const double north = kMetresPerDegree * (latitude - exif.latitude);
  const double east =
      kMetresPerDegree * std::remainder(longitude - exif.longitude, 360) * std::cos(latitude * std::numbers::pi / 180);
  return std::abs(north) <= std::max(kLeast, kMetresPerDegree * fix.latitudeStep) &&
         std::abs(east) <= std::max(kLeast, kMetresPerDegree * fix.longitudeStep);
}

bool makesSense(const GpsFix& fix) {
  return std::abs(fix.latitude) <= 90 && std::abs(fix.longitude) <= 180 && std::abs(fix.altitude) < 1e5 &&
         (fix.latitude != 0 || fix.longitude != 0);  // a receiver without a fix writes 0, 0
}

}  // namespace

std::optional<double> exposureStops(const ExposureTags& exposure) {
  if (!(exposure.seconds > 0) || !(exposure.iso > 0)) return std::nullopt;
  const double aperture = exposure.aperture > 0 ? exposure.aperture : 1;
  return std::log2(exposure.seconds * exposure.iso / (aperture * aperture));
}

std::vector<std::optional<double>> comparableStops(std::span<const ExposureTags> exposures) {
  int with = 0, without = 0;
  for (const ExposureTags& exposure : exposures)
    if (exposureStops(exposure)) ++(exposure.aperture > 0 ? with : without);
  std::vector<std::optional<double>> stops;
  for (const ExposureTags& exposure : exposures)
    stops.push_back((exposure.aperture > 0) == (with >= without) ? exposureStops(exposure) : std::nullopt);
  return stops;
}

PhotoTags decodePhotoTags(std::span<const std::byte> jpeg) {
  PhotoTags tags;
  constexpr size_t kMax = size_t{1} << 28;
  const auto* bytes = reinterpret_cast<const unsigned char*>(jpeg.data());
  if (jpeg.size() < 4 || bytes[0] != 0xff || bytes[1] != 0xd8) return tags;
  jpeg = jpeg.first(std::min(jpeg.size(), kMax));
  const std::unique_ptr<ExifData, DeleteExif> data(
      exif_data_new_from_data(bytes, static_cast<unsigned int>(jpeg.size())));
  std::optional<ExifFix> exif;
  if (data != nullptr) {
    exif = readGpsFix(*data);
    if (exif) tags.gps = exif->fix;
    tags.camera = readCamera(*data);
    tags.exposure = {positive(*data, EXIF_IFD_EXIF, EXIF_TAG_EXPOSURE_TIME),
                     positive(*data, EXIF_IFD_EXIF, EXIF_TAG_ISO_SPEED_RATINGS),
                     positive(*data, EXIF_IFD_EXIF, EXIF_TAG_FNUMBER)};
    tags.takenAt = readTime(*data);
    const double orientation = positive(*data, EXIF_IFD_0, EXIF_TAG_ORIENTATION);
    if (orientation >= 1 && orientation <= 8) tags.orientation = static_cast<int>(orientation);
  }

  const std::string_view text(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  const size_t begin = text.find("<x:xmpmeta");
  const size_t end = begin == text.npos ? text.npos : text.find("</x:xmpmeta>", begin);
  if (end != text.npos) {
    const XmpTags xmp = decodeXmp(text.substr(begin, end - begin));
    // Receivers with corrections write more digits there than in EXIF.
    const bool isCorrected = tags.gps && makesSense(*tags.gps) && xmp.latitude && xmp.longitude &&
                             !isSamePlace(*exif, *xmp.latitude, *xmp.longitude);
    if (xmp.latitude && xmp.longitude && !isCorrected) {
      GpsFix fix = tags.gps.value_or(GpsFix{.hasAltitude = false});
      fix.latitude = *xmp.latitude;
      fix.longitude = *xmp.longitude;
      if (makesSense(fix)) tags.gps = fix;
    }
    if (tags.gps && xmp.absoluteAltitude && !(isCorrected && tags.gps->hasAltitude)) {
      tags.gps->altitude = *xmp.absoluteAltitude;
      tags.gps->hasAltitude = true;
    }
    if (tags.gps && xmp.relativeAltitude && std::abs(*xmp.relativeAltitude) < 1e5) {
      tags.gps->relativeAltitude = *xmp.relativeAltitude;
    }
    tags.camera.isThermal = xmp.isInfrared;
    tags.camera.isPanorama = xmp.isPanorama;
    if (xmp.gimbalPitch && std::abs(*xmp.gimbalPitch) <= 180) {
      tags.gimbal = GimbalAngles{xmp.gimbalYaw.value_or(0), *xmp.gimbalPitch, xmp.gimbalRoll.value_or(0)};
    }
  }
  if (tags.gps && !makesSense(*tags.gps)) tags.gps.reset();
  return tags;
}

Bytes readPhotoHead(const fs::path& file) {
  Bytes head;
  for (const uint64_t bytes : {uint64_t{1} << 17, uint64_t{1} << 20, uint64_t{1} << 25}) {
    head = readFileStart(file, bytes);
    const bool mayNeedMore = head.size() == bytes && head[0] == std::byte{0xff} && head[1] == std::byte{0xd8};
    if (!mayNeedMore || probeImage(head)) break;
  }
  return head;
}

}  // namespace tessera
