#include "import/exif.h"

#include <libexif/exif-data.h>

#include <cmath>
#include <memory>

namespace tessera {
namespace {

struct DeleteExif {
  void operator()(ExifData* data) const { exif_data_unref(data); }
};

const ExifEntry* gpsEntry(const ExifData& data, int tag, ExifFormat format, unsigned long components) {
  const ExifEntry* entry = exif_content_get_entry(data.ifd[EXIF_IFD_GPS], static_cast<ExifTag>(tag));
  const bool fits = entry != nullptr && entry->data != nullptr && entry->format == format &&
                    entry->components >= components && entry->size >= components * exif_format_get_size(format);
  return fits ? entry : nullptr;
}

std::optional<double> rational(const ExifData& data, const ExifEntry& entry, size_t index) {
  const ExifRational value =
      exif_get_rational(entry.data + 8 * index, exif_data_get_byte_order(const_cast<ExifData*>(&data)));
  if (value.denominator == 0) return value.numerator == 0 ? std::optional(0.0) : std::nullopt;
  return static_cast<double>(value.numerator) / value.denominator;
}

// Reads an angle of degrees, minutes and seconds, negative if the reference letter is `negative`.
std::optional<double> angle(const ExifData& data, int tag, int referenceTag, char negative) {
  const ExifEntry* entry = gpsEntry(data, tag, EXIF_FORMAT_RATIONAL, 3);
  const ExifEntry* reference = gpsEntry(data, referenceTag, EXIF_FORMAT_ASCII, 1);
  if (entry == nullptr || reference == nullptr) return std::nullopt;
  const auto degrees = rational(data, *entry, 0), minutes = rational(data, *entry, 1),
             seconds = rational(data, *entry, 2);
  if (!degrees || !minutes || !seconds) return std::nullopt;
  const double value = *degrees + *minutes / 60 + *seconds / 3600;
  return static_cast<char>(reference->data[0]) == negative ? -value : value;
}

std::optional<GpsFix> readGpsFix(const ExifData& data) {
  const auto latitude = angle(data, EXIF_TAG_GPS_LATITUDE, EXIF_TAG_GPS_LATITUDE_REF, 'S');
  const auto longitude = angle(data, EXIF_TAG_GPS_LONGITUDE, EXIF_TAG_GPS_LONGITUDE_REF, 'W');
  if (!latitude || !longitude) return std::nullopt;
  GpsFix fix{*latitude, *longitude, 0, 0};
  if (const ExifEntry* altitude = gpsEntry(data, EXIF_TAG_GPS_ALTITUDE, EXIF_FORMAT_RATIONAL, 1)) {
    const ExifEntry* reference = gpsEntry(data, EXIF_TAG_GPS_ALTITUDE_REF, EXIF_FORMAT_BYTE, 1);
    fix.altitude = rational(data, *altitude, 0).value_or(0);
    if (reference != nullptr && reference->data[0] == 1) fix.altitude = -fix.altitude;
  }
  return fix;
}

bool makesSense(const GpsFix& fix) {
  return std::abs(fix.latitude) <= 90 && std::abs(fix.longitude) <= 180 && std::abs(fix.altitude) < 1e5 &&
         (fix.latitude != 0 || fix.longitude != 0);  // a receiver without a fix writes 0, 0
}

}  // namespace

PhotoTags decodePhotoTags(std::span<const std::byte> jpeg) {
  PhotoTags tags;
  constexpr size_t kMax = size_t{1} << 28;
  const auto* bytes = reinterpret_cast<const unsigned char*>(jpeg.data());
  if (jpeg.size() < 4 || bytes[0] != 0xff || bytes[1] != 0xd8) return tags;
  jpeg = jpeg.first(std::min(jpeg.size(), kMax));
  const std::unique_ptr<ExifData, DeleteExif> data(
      exif_data_new_from_data(bytes, static_cast<unsigned int>(jpeg.size())));
  if (data != nullptr) tags.gps = readGpsFix(*data);

  const std::string_view text(reinterpret_cast<const char*>(jpeg.data()), jpeg.size());
  const size_t begin = text.find("<x:xmpmeta");
  const size_t end = begin == text.npos ? text.npos : text.find("</x:xmpmeta>", begin);
  if (end != text.npos) {
    const XmpTags xmp = decodeXmp(text.substr(begin, end - begin));
    if (!tags.gps && xmp.latitude && xmp.longitude) tags.gps = GpsFix{*xmp.latitude, *xmp.longitude, 0, 0};
    if (tags.gps && xmp.absoluteAltitude) tags.gps->altitude = *xmp.absoluteAltitude;
    if (tags.gps && xmp.relativeAltitude && std::abs(*xmp.relativeAltitude) < 1e5) {
      tags.gps->relativeAltitude = *xmp.relativeAltitude;
    }
    if (xmp.gimbalPitch && std::abs(*xmp.gimbalPitch) <= 180) {
      tags.gimbal = GimbalAngles{xmp.gimbalYaw.value_or(0), *xmp.gimbalPitch, xmp.gimbalRoll.value_or(0)};
    }
  }
  if (tags.gps && !makesSense(*tags.gps)) tags.gps.reset();
  return tags;
}

}  // namespace tessera
