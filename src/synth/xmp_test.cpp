#include "synth/xmp.h"

#include <gtest/gtest.h>

#include <numbers>

#include "base/image_io.h"
#include "import/exif.h"
#include "synth/exif.h"
#include "synth/flights.h"

namespace tessera {
namespace {

constexpr double kRadiansPerDegree = std::numbers::pi / 180;

Bytes photoAt(double yaw, double pitch, double roll) {
  const GpsFix gps{46.5, 6.5, 431.25, 59.5};
  const Bytes jpeg = encodeJpeg(ImageU8(8, 8, 3), 90, encodeExif({.gps = gps}));
  return withSegment(jpeg, encodeXmpSegment({gps, cameraRotation(yaw * kRadiansPerDegree, -pitch * kRadiansPerDegree,
                                                                 roll * kRadiansPerDegree)}));
}

TEST(Xmp, GivesHeightsBesideTheExif) {
  const PhotoTags tags = decodePhotoTags(photoAt(0, -90, 0));
  ASSERT_TRUE(tags.gps);
  EXPECT_NEAR(tags.gps->latitude, 46.5, 1e-9);
  EXPECT_NEAR(tags.gps->altitude, 431.25, 1e-9);
  EXPECT_NEAR(tags.gps->relativeAltitude, 59.5, 1e-9);
}

TEST(Xmp, GivesTheAnglesOfTheGimbal) {
  for (const GimbalAngles& expected :
       {GimbalAngles{20, -50, 0}, {-130, -30, 2}, {95, -45, -3}, {-60, -89, 0}, {30, -90, 0}}) {
    const PhotoTags tags = decodePhotoTags(photoAt(expected.yaw, expected.pitch, expected.roll));
    ASSERT_TRUE(tags.gimbal);
    EXPECT_NEAR(tags.gimbal->yaw, expected.yaw, 0.01);
    EXPECT_NEAR(tags.gimbal->pitch, expected.pitch, 0.01);
    EXPECT_NEAR(tags.gimbal->roll, expected.roll, 0.01);
  }
}

TEST(Xmp, LeavesThePictureAsItIs) {
  const auto decoded = decodeImage(photoAt(0, -90, 0));
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->image.width, 8);
  EXPECT_FALSE(decoded->truncated);
}

}  // namespace
}  // namespace tessera
