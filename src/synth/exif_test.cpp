#include "synth/exif.h"

#include <gtest/gtest.h>
#include <libexif/exif-data.h>

#include <cmath>
#include <memory>

namespace tessera {
namespace {

using Exif = std::unique_ptr<ExifData, decltype(&exif_data_unref)>;

Exif parsed(const Bytes& bytes) {
  return {exif_data_new_from_data(reinterpret_cast<const unsigned char*>(bytes.data()),
                                  static_cast<unsigned>(bytes.size())),
          exif_data_unref};
}

double rationalAt(const ExifEntry* entry, int index) {
  const ExifRational r = exif_get_rational(entry->data + 8 * index, exif_data_get_byte_order(entry->parent->parent));
  return static_cast<double>(r.numerator) / r.denominator;
}

double gpsDegrees(ExifData* data, int tag) {
  const ExifEntry* entry = exif_content_get_entry(data->ifd[EXIF_IFD_GPS], static_cast<ExifTag>(tag));
  return entry == nullptr || entry->components != 3
             ? 1e9
             : rationalAt(entry, 0) + rationalAt(entry, 1) / 60 + rationalAt(entry, 2) / 3600;
}

TEST(Exif, GivesGpsToTenthsOfAMillimetre) {
  const Exif data = parsed(encodeExif({.gps = {46.453112345, -6.541298765, 432.125, 60}}));
  EXPECT_NEAR(gpsDegrees(data.get(), 0x0002), 46.453112345, 1e-9);
  EXPECT_NEAR(gpsDegrees(data.get(), 0x0004), 6.541298765, 1e-9);
  const ExifEntry* west = exif_content_get_entry(data->ifd[EXIF_IFD_GPS], static_cast<ExifTag>(0x0003));
  ASSERT_NE(west, nullptr);
  EXPECT_EQ(west->data[0], 'W');
  const ExifEntry* altitude = exif_content_get_entry(data->ifd[EXIF_IFD_GPS], static_cast<ExifTag>(0x0006));
  ASSERT_NE(altitude, nullptr);
  EXPECT_NEAR(rationalAt(altitude, 0), 432.125, 1e-9);
}

TEST(Exif, MarksHeightsBelowTheEllipsoid) {
  const Exif data = parsed(encodeExif({.gps = {-33.5, 151.25, -4.5, 0}}));
  const ExifEntry* below = exif_content_get_entry(data->ifd[EXIF_IFD_GPS], static_cast<ExifTag>(0x0005));
  ASSERT_NE(below, nullptr);
  EXPECT_EQ(below->data[0], 1);
  EXPECT_EQ(exif_content_get_entry(data->ifd[EXIF_IFD_GPS], static_cast<ExifTag>(0x0001))->data[0], 'S');
}

TEST(Exif, RecordsCameraAndTime) {
  const Exif data = parsed(encodeExif({.focalLength35 = 28.3, .exposure = 1, .seconds = 3725}));
  char text[64] = {};
  const auto value = [&](ExifIfd ifd, ExifTag tag) {
    ExifEntry* entry = exif_content_get_entry(data->ifd[ifd], tag);
    return entry == nullptr ? std::string("missing") : std::string(exif_entry_get_value(entry, text, sizeof text));
  };
  EXPECT_EQ(value(EXIF_IFD_0, EXIF_TAG_MAKE), "tessera");
  EXPECT_EQ(value(EXIF_IFD_EXIF, EXIF_TAG_DATE_TIME_ORIGINAL), "2024:06:21 11:02:05");
  EXPECT_EQ(value(EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM), "28");
  const ExifEntry* time = exif_content_get_entry(data->ifd[EXIF_IFD_EXIF], EXIF_TAG_EXPOSURE_TIME);
  ASSERT_NE(time, nullptr);
  EXPECT_NEAR(rationalAt(time, 0), 2.0 / 500, 1e-9) << "one stop longer";
}

TEST(Exif, DividesExposureBetweenTimeAndIso) {
  const Exif data = parsed(encodeExif({.exposure = 0.5, .isoStops = 2}));
  const ExifEntry* time = exif_content_get_entry(data->ifd[EXIF_IFD_EXIF], EXIF_TAG_EXPOSURE_TIME);
  const ExifEntry* iso = exif_content_get_entry(data->ifd[EXIF_IFD_EXIF], EXIF_TAG_ISO_SPEED_RATINGS);
  ASSERT_NE(time, nullptr);
  ASSERT_NE(iso, nullptr);
  EXPECT_EQ(exif_get_short(iso->data, exif_data_get_byte_order(data.get())), 400);
  EXPECT_NEAR(rationalAt(time, 0) * 4, std::exp2(0.5) / 500, 1e-8);
}

}  // namespace
}  // namespace tessera
