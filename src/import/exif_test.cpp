#include "import/exif.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/testing/shared_data.h"
#include "import/testing/test_support.h"

namespace tessera {
namespace {

TEST(Xmp, ReadsAttributesWithSigns) {
  const XmpTags tags = decodeXmp(
      R"(<rdf:Description drone-dji:AbsoluteAltitude="+198.31" drone-dji:RelativeAltitude='-3.5'
         drone-dji:GimbalPitchDegree = "-89.90" drone-dji:GpsLatitude=" 50.5 " drone-dji:GpsLongtitude="+0.25">)");
  EXPECT_EQ(tags.absoluteAltitude, 198.31);
  EXPECT_EQ(tags.relativeAltitude, -3.5);
  EXPECT_EQ(tags.gimbalPitch, -89.9);
  EXPECT_EQ(tags.latitude, 50.5);
  EXPECT_EQ(tags.longitude, 0.25);  // misspelt by older firmware
  EXPECT_FALSE(tags.gimbalYaw.has_value());
}

TEST(Xmp, ReadsElements) {
  const XmpTags tags = decodeXmp(
      "<drone-dji:GpsLatitude>-12.5</drone-dji:GpsLatitude>\n<drone-dji:GpsLongitude>\n+77 </drone-dji:GpsLongitude>");
  EXPECT_EQ(tags.latitude, -12.5);
  EXPECT_EQ(tags.longitude, 77);
}

TEST(Xmp, TellsInfraredPicturesOfTwoCameras) {
  EXPECT_TRUE(decodeXmp("drone-dji:ImageSource=\"InfraredCamera\"").isInfrared);
  EXPECT_FALSE(decodeXmp("drone-dji:ImageSource=\"WideCamera\"").isInfrared);
  EXPECT_TRUE(decodeXmp("<GPano:ProjectionType>equirectangular</GPano:ProjectionType>").isPanorama);
  EXPECT_FALSE(decodeXmp("GPano:ProjectionType=\"rectilinear\"").isPanorama);
  EXPECT_FALSE(decodeXmp("drone-dji:GimbalYawDegree=\"1\"").isInfrared);
}

TEST(Xmp, IgnoresOtherNamesAndOtherText) {
  const XmpTags tags = decodeXmp(
      "x:GpsLatitudeRef=\"5\" GpsLatitude=\"6\" x:GpsLongitude=\"east\" x:RelativeAltitude=\"1e999\" "
      "x:AbsoluteAltitude=12 x:GimbalYawDegree=\"1 2\" x:GimbalRollDegree>");
  EXPECT_FALSE(tags.latitude || tags.longitude || tags.relativeAltitude || tags.absoluteAltitude || tags.gimbalYaw ||
               tags.gimbalRoll);
}

// Builds a little-endian EXIF block that contains only a GPS directory.
class ExifBuilder {
 public:
  ExifBuilder& entry(uint16_t tag, uint16_t format, uint32_t count, std::vector<uint8_t> value) {
    entries_.push_back({tag, format, count, std::move(value)});
    return *this;
  }
  ExifBuilder& rationals(uint16_t tag, const std::vector<uint32_t>& values) {
    std::vector<uint8_t> bytes;
    for (uint32_t v : values) put(bytes, v, 4);
    return entry(tag, 5, static_cast<uint32_t>(values.size() / 2), bytes);
  }
  Bytes exif() const {
    std::vector<uint8_t> out = {'E', 'x', 'i', 'f', 0, 0, 'I', 'I', 42, 0, 8, 0, 0, 0};
    put(out, 1, 2);
    put(out, 0x8825, 2);
    put(out, 4, 2);
    put(out, 1, 4);
    put(out, 26, 4);  // offset of the GPS directory from "II"
    put(out, 0, 4);
    put(out, entries_.size(), 2);
    std::vector<uint8_t> data;
    const size_t dataAt = 26 + 2 + 12 * entries_.size() + 4;
    for (const Entry& e : entries_) {
      put(out, e.tag, 2);
      put(out, e.format, 2);
      put(out, e.count, 4);
      if (e.value.size() <= 4) {
        std::vector<uint8_t> padded = e.value;
        padded.resize(4);
        out.insert(out.end(), padded.begin(), padded.end());
      } else {
        put(out, dataAt + data.size(), 4);
        data.insert(data.end(), e.value.begin(), e.value.end());
      }
    }
    put(out, 0, 4);
    out.insert(out.end(), data.begin(), data.end());
    Bytes bytes(out.size());
    std::transform(out.begin(), out.end(), bytes.begin(), [](uint8_t b) { return std::byte{b}; });
    return bytes;
  }

 private:
  struct Entry {
    uint16_t tag, format;
    uint32_t count;
    std::vector<uint8_t> value;
  };
  static void put(std::vector<uint8_t>& out, uint64_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
  }
  std::vector<Entry> entries_;
};

ExifBuilder southWest() {
  ExifBuilder builder;
  builder.entry(1, 2, 2, {'S', 0}).rationals(2, {50, 1, 30, 1, 3600, 100});
  builder.entry(3, 2, 2, {'W', 0}).rationals(4, {0, 1, 15, 1, 0, 1});
  builder.entry(5, 1, 1, {1}).rationals(6, {25, 2});
  return builder;
}

TEST(Exif, TellsThatTheAltitudeIsUnknown) {
  ExifBuilder builder;
  builder.entry(1, 2, 2, {'N', 0}).rationals(2, {50, 1, 30, 1, 3600, 100});
  builder.entry(3, 2, 2, {'E', 0}).rationals(4, {0, 1, 15, 1, 0, 1});
  const PhotoTags tags = decodePhotoTags(encodeJpeg(gradientPicture(8, 8), 90, builder.exif()));
  ASSERT_TRUE(tags.gps.has_value());
  EXPECT_FALSE(tags.gps->hasAltitude);
}

// Of receivers that know their height or their place only in part.
TEST(Exif, TakesZeroOverZeroForUnknown) {
  const auto read = [](const std::vector<uint32_t>& latitude, const std::vector<uint32_t>& altitude) {
    ExifBuilder builder;
    builder.entry(1, 2, 2, {'N', 0}).rationals(2, latitude);
    builder.entry(3, 2, 2, {'E', 0}).rationals(4, {8, 1, 15, 1, 0, 1});
    builder.entry(5, 1, 1, {0}).rationals(6, altitude);
    return decodePhotoTags(encodeJpeg(gradientPicture(8, 8), 90, builder.exif())).gps;
  };
  ASSERT_TRUE(read({505, 10, 0, 0, 0, 0}, {0, 0}).has_value());
  EXPECT_EQ(read({505, 10, 0, 0, 0, 0}, {0, 0})->latitude, 50.5);
  EXPECT_FALSE(read({505, 10, 0, 0, 0, 0}, {0, 0})->hasAltitude);
  EXPECT_TRUE(read({505, 10, 0, 0, 0, 0}, {0, 1})->hasAltitude) << "at the sea";
  EXPECT_FALSE(read({0, 0, 0, 0, 0, 0}, {1, 1}).has_value());
  EXPECT_FALSE(read({50, 1, 7, 0, 0, 0}, {1, 1}).has_value());
}

TEST(Exif, ReadsGpsWithItsReferences) {
  const PhotoTags tags = decodePhotoTags(encodeJpeg(gradientPicture(8, 8), 90, southWest().exif()));
  ASSERT_TRUE(tags.gps.has_value());
  EXPECT_NEAR(tags.gps->latitude, -(50 + 0.5 + 0.01), 1e-12);
  EXPECT_NEAR(tags.gps->longitude, -0.25, 1e-12);
  EXPECT_EQ(tags.gps->altitude, -12.5);  // below the sea
  EXPECT_TRUE(tags.gps->hasAltitude);
  EXPECT_FALSE(tags.gimbal.has_value());
}

// An EXIF block whose only tag is an orientation.
Bytes exifWithOrientation(uint8_t value) {
  const std::vector<uint8_t> block = {'E',  'x', 'i', 'f', 0, 0, 'I', 'I', 42,    0, 8, 0, 0, 0, 1, 0,
                                      0x12, 1,   3,   0,   1, 0, 0,   0,   value, 0, 0, 0, 0, 0, 0, 0};
  Bytes bytes(block.size());
  std::transform(block.begin(), block.end(), bytes.begin(), [](uint8_t b) { return std::byte{b}; });
  return bytes;
}

TEST(Exif, ReadsHowViewersTurnThePicture) {
  const auto read = [](uint8_t value) {
    return decodePhotoTags(encodeJpeg(gradientPicture(8, 8), 90, exifWithOrientation(value))).orientation;
  };
  for (uint8_t value = 1; value <= 8; ++value) EXPECT_EQ(read(value), value);
  for (const uint8_t value : {0, 9, 255}) EXPECT_EQ(read(value), 1) << "not a value of EXIF";
  EXPECT_EQ(decodePhotoTags(encodeJpeg(gradientPicture(8, 8))).orientation, 1) << "without the tag";
}

TEST(Exif, ReturnsNoFixForFilesWithoutGpsTags) {
  EXPECT_FALSE(decodePhotoTags(encodeJpeg(gradientPicture(8, 8))).gps.has_value());
  EXPECT_FALSE(decodePhotoTags(encodePng(gradientPicture(8, 8))).gps.has_value());
  EXPECT_FALSE(decodePhotoTags({}).gps.has_value());
}

TEST(Exif, ReturnsTheWholeFixOrNoneForEveryTruncation) {
  const Bytes jpeg = encodeJpeg(gradientPicture(8, 8), 90, southWest().exif());
  const PhotoTags whole = decodePhotoTags(jpeg);
  ASSERT_TRUE(whole.gps.has_value());
  size_t fixes = 0;
  for (size_t length = 0; length < jpeg.size(); ++length) {
    const PhotoTags tags = decodePhotoTags(std::span(jpeg).first(length));
    if (!tags.gps) continue;
    ++fixes;
    EXPECT_EQ(tags.gps->latitude, whole.gps->latitude) << length;
    EXPECT_EQ(tags.gps->longitude, whole.gps->longitude) << length;
  }
  EXPECT_GT(fixes, 0u) << "what is cut off behind the tags costs no fix";
  EXPECT_LT(fixes, jpeg.size() - 100) << "what is cut off before their end does";
}

TEST(Exif, RejectsImplausibleFixes) {
  ExifBuilder zero;
  zero.entry(1, 2, 2, {'N', 0})
      .rationals(2, {0, 1, 0, 1, 0, 1})
      .entry(3, 2, 2, {'E', 0})
      .rationals(4, {0, 0, 0, 0, 0, 0});
  EXPECT_FALSE(decodePhotoTags(encodeJpeg(gradientPicture(8, 8), 90, zero.exif())).gps.has_value());
  ExifBuilder beyond;
  beyond.entry(1, 2, 2, {'N', 0})
      .rationals(2, {91, 1, 0, 1, 0, 1})
      .entry(3, 2, 2, {'E', 0})
      .rationals(4, {1, 1, 0, 1, 0, 1});
  EXPECT_FALSE(decodePhotoTags(encodeJpeg(gradientPicture(8, 8), 90, beyond.exif())).gps.has_value());
}

// Returns the fix of a photo with these tags in EXIF and these attributes in XMP.
std::optional<GpsFix> readFix(const ExifBuilder& exif, const std::string& xmp) {
  Bytes jpeg = encodeJpeg(gradientPicture(8, 8), 90, exif.exif());
  const std::string packet = "<x:xmpmeta " + xmp + "></x:xmpmeta>";
  const auto* begin = reinterpret_cast<const std::byte*>(packet.data());
  jpeg.insert(jpeg.end(), begin, begin + packet.size());
  return decodePhotoTags(jpeg).gps;
}

TEST(Exif, PrefersThePositionOfXmpUnlessItMakesNoSense) {
  const auto read = [](const std::string& xmp) { return readFix(southWest(), xmp); };
  const auto precise = read("a:GpsLatitude=\"-50.51000123\" a:GpsLongitude=\"-0.25000123\"");
  ASSERT_TRUE(precise.has_value());
  EXPECT_EQ(precise->latitude, -50.51000123);
  EXPECT_EQ(precise->altitude, -12.5) << "that of EXIF, as there is no other";
  const std::string altitude = " a:AbsoluteAltitude=\"7\"";
  EXPECT_EQ(read("a:GpsLatitude=\"-50.51000123\" a:GpsLongitude=\"-0.25000123\"" + altitude)->altitude, 7);
  const auto corrected = read("a:GpsLatitude=\"-50.51001\" a:GpsLongitude=\"-0.25\"" + altitude);
  ASSERT_TRUE(corrected.has_value());
  EXPECT_NEAR(corrected->latitude, -50.51, 1e-12) << "more than a metre off: corrected in EXIF";
  EXPECT_EQ(corrected->altitude, -12.5);
  for (const char* xmp : {"a:GpsLatitude=\"0\" a:GpsLongitude=\"0\"", "a:GpsLatitude=\"50.1\"",
                          "a:GpsLatitude=\"99\" a:GpsLongitude=\"8\""}) {
    ASSERT_TRUE(read(xmp).has_value());
    EXPECT_NEAR(read(xmp)->latitude, -50.51, 1e-12) << xmp;
  }
}

TEST(Exif, PrefersThePositionOfXmpToWholeSeconds) {
  // 31 metres a second of arc.
  ExifBuilder coarse;
  coarse.entry(1, 2, 2, {'N', 0})
      .rationals(2, {50, 1, 30, 1, 36, 1})
      .entry(3, 2, 2, {'E', 0})
      .rationals(4, {8, 1, 15, 1, 0, 1});
  const auto fix = readFix(coarse, "a:GpsLatitude=\"50.5102\" a:GpsLongitude=\"8.2501\"");
  ASSERT_TRUE(fix.has_value());
  EXPECT_EQ(fix->latitude, 50.5102);
}

TEST(Exif, CountsExposureInStops) {
  EXPECT_EQ(exposureStops({0.01, 200, 2}), std::log2(0.01 * 200 / 4));
  EXPECT_EQ(exposureStops({0.01, 200, 0}), std::log2(0.01 * 200)) << "a lens without an aperture";
  EXPECT_FALSE(exposureStops({0, 200, 2}).has_value());
  EXPECT_FALSE(exposureStops({0.01, 0, 2}).has_value());
}

TEST(Exif, ComparesExposuresOfMostPhotos) {
  const ExposureTags with{0.01, 200, 2}, without{0.01, 200, 0}, unknown{0, 200, 2};
  const auto known = [](const std::vector<ExposureTags>& tags) {
    std::string text;
    for (const auto& stops : comparableStops(tags)) text += stops ? "k" : "-";
    return text;
  };
  EXPECT_EQ(known({with, with, without, unknown}), "kk--");
  EXPECT_EQ(known({without, with, without, unknown}), "k-k-");
  EXPECT_EQ(known({without, without}), "kk");
  EXPECT_EQ(known({unknown}), "-");
  EXPECT_EQ(comparableStops(std::vector<ExposureTags>{with})[0], exposureStops(with));
}

TEST(Exif, ReadsARealDrone) {
  SKIP_WITHOUT_SHARED_DATA("brighton_beach");
  const fs::path beach = sharedData("brighton_beach");
  const PhotoTags tags = decodePhotoTags(readFile(beach / "images/DJI_0018.JPG"));
  ASSERT_TRUE(tags.gps.has_value());
  EXPECT_EQ(tags.gps->altitude, 198.31);
  EXPECT_EQ(tags.gps->relativeAltitude, 39.80);
  ASSERT_TRUE(tags.gimbal.has_value());
  EXPECT_EQ(tags.gimbal->pitch, -89.9);
  EXPECT_EQ(tags.gimbal->yaw, 45);
  EXPECT_EQ(tags.camera.make, "DJI");
  EXPECT_EQ(tags.camera.model, "FC300S");
  EXPECT_FALSE(tags.camera.isThermal);
  EXPECT_GT(tags.camera.focalLength35, 15);
  EXPECT_LT(tags.camera.focalLength35, 25);
  EXPECT_GT(tags.exposure.seconds, 1e-4);
  EXPECT_LT(tags.exposure.seconds, 0.1);
  EXPECT_GE(tags.exposure.iso, 100);
  EXPECT_NEAR(tags.exposure.aperture, 2.8, 1e-6);
  ASSERT_TRUE(tags.takenAt);
  const auto other = decodePhotoTags(readFile(beach / "images/DJI_0019.JPG")).takenAt;
  ASSERT_TRUE(other);
  EXPECT_GT(*other, *tags.takenAt);
  EXPECT_LT(*other, *tags.takenAt + 60);
}

}  // namespace
}  // namespace tessera
