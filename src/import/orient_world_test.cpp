#include "import/orient_world.h"

#include <gtest/gtest.h>

#include <cmath>

#include "import/georeference.h"
#include "import/testing/flights.h"

namespace tessera {
namespace {

TEST(Orient, FindsEastNorthUpInMetresFromGps) {
  SourceCapture source = flight();
  const Capture original = source.capture;
  scramble(source);
  const Capture scrambled = source.capture;
  const Orientation orientation = orientWorld(source, {});
  expectEastNorthUp(source.capture, 1e-3);  // the Earth's curve over the flight
  EXPECT_NEAR(orientation.scale, 1 / 0.07, 1e-4);

  // Check the transforms back to the source's world and to the position on the Earth.
  const Photo& photo = source.capture.photos[7];
  const Vec3d inSource = (source.capture.sourceFromWorld * photo.worldFromCamera.translation.homogeneous()).head<3>();
  EXPECT_NEAR((inSource - scrambled.photos[7].worldFromCamera.translation).norm(), 0, 1e-9);
  ASSERT_TRUE(source.capture.geo.has_value());
  const GeoFrame& geo = *source.capture.geo;
  const Vec3d enu = (geo.enuFromWorld * photo.worldFromCamera.translation.homogeneous()).head<3>();
  EXPECT_NEAR((enu - enuFromGps(geo, photo.gps->latitude, photo.gps->longitude, photo.gps->altitude)).norm(), 0, 1e-3);
}

// The product of a number and its reciprocal is often not 1: a general inverse had another last row for one scale in
// seven.
TEST(Orient, KeepsItsMapsAffineAtAnyScale) {
  for (int i = 1; i < 200; ++i) {
    SourceCapture source = flight();
    Mat4d other = Mat4d::Identity();
    const Mat3d turn = Eigen::AngleAxisd(0.1 * i, Vec3d(1, 2, 3).normalized()).toRotationMatrix();
    other.topLeftCorner<3, 3>() = 0.037 * i * turn;
    applySimilarity(source.capture, other);
    orientWorld(source, {});
    const Eigen::RowVector4d last(0, 0, 0, 1);
    EXPECT_EQ(source.capture.sourceFromWorld.row(3), last) << i;
    ASSERT_TRUE(source.capture.geo.has_value());
    EXPECT_EQ(source.capture.geo->enuFromWorld.row(3), last) << i;
  }
}

TEST(Orient, RecentresAtTheMedianCamera) {
  for (const bool hasGps : {true, false}) {
    SourceCapture source = flight();
    for (Photo& photo : source.capture.photos)
      if (!hasGps) photo.gps.reset();
    scramble(source);
    orientWorld(source, {});
    for (int axis = 0; axis < 3; ++axis) {
      int below = 0, above = 0;
      for (const Photo& photo : source.capture.photos) {
        below += photo.worldFromCamera.translation[axis] < 0 ? 1 : 0;
        above += photo.worldFromCamera.translation[axis] > 0 ? 1 : 0;
      }
      EXPECT_LE(below, 10) << axis;
      EXPECT_LE(above, 10) << axis;
      EXPECT_GT(below, 0) << axis;
    }
  }
}

TEST(Orient, PrefersTheBarometerToGpsHeights) {
  SourceCapture source = flight();
  int i = 0;
  for (Photo& photo : source.capture.photos) {
    photo.gps->relativeAltitude = photo.worldFromCamera.translation.z() - 20;  // took off on a hill
    photo.gps->altitude += i++ % 3 * 5;
  }
  scramble(source);
  orientWorld(source, {});
  expectEastNorthUp(source.capture, 1e-2);
}

void forgetGps(SourceCapture& source) {
  for (Photo& photo : source.capture.photos) photo.gps.reset();
}

TEST(Orient, FindsUpOfANadirFlightFromThePlaneOfItsCameras) {
  SourceCapture source = flight();
  forgetGps(source);
  for (Photo& photo : source.capture.photos) photo.worldFromCamera.translation.z() = 60;
  scramble(source);
  orientWorld(source, {});
  for (const Photo& photo : source.capture.photos) EXPECT_LT(photo.worldFromCamera.rotation.col(2).z(), -0.9999);
}

TEST(Orient, PrefersGimbalAnglesToOtherCues) {
  // Oblique photos in one direction: the cameras' up alone would be wrong by 60°.
  SourceCapture source = flight();
  forgetGps(source);
  const Mat3d tilt = Eigen::AngleAxisd(-60 * M_PI / 180, Vec3d::UnitX()).toRotationMatrix();
  for (Photo& photo : source.capture.photos) {
    Mat3d level;  // looks north
    level.col(0) = Vec3d::UnitX();
    level.col(1) = -Vec3d::UnitZ();
    level.col(2) = Vec3d::UnitY();
    photo.worldFromCamera.rotation = tilt * level;
  }
  EXPECT_LT(source.capture.photos[0].worldFromCamera.rotation.col(2).z(), 0);  // looks down
  scramble(source);
  orientWorld(source, std::vector<UprightTags>(20, {GimbalAngles{0, -60, 0}, 1}));
  EXPECT_NEAR(source.capture.photos[0].worldFromCamera.rotation.col(2).z(), -std::sin(60 * M_PI / 180), 1e-9);
}

TEST(Orient, TakesUpFromUprightCameras) {
  SourceCapture source;
  for (int i = 0; i < 12; ++i) {  // an orbit
    Photo photo;
    const double angle = i * M_PI / 6;
    photo.worldFromCamera.rotation.col(2) = Vec3d(-std::cos(angle), -std::sin(angle), 0);
    photo.worldFromCamera.rotation.col(1) = -Vec3d::UnitZ();
    photo.worldFromCamera.rotation.col(0) =
        photo.worldFromCamera.rotation.col(1).cross(photo.worldFromCamera.rotation.col(2));
    photo.worldFromCamera.translation = Vec3d(5 * std::cos(angle), 5 * std::sin(angle), 1);
    source.capture.photos.push_back(photo);
  }
  scramble(source);
  orientWorld(source, {});
  for (const Photo& photo : source.capture.photos) {
    EXPECT_NEAR((photo.worldFromCamera.rotation.col(1) + Vec3d::UnitZ()).norm(), 0, 1e-9);
  }
}

// Viewers turn pictures of the orientation 6 by 90 degrees clockwise: their up is on the left.
TEST(Orient, TakesUpFromPicturesThatViewersTurn) {
  const std::pair<int, Vec3d> cases[] = {{1, -Vec3d::UnitY()}, {2, -Vec3d::UnitY()}, {3, Vec3d::UnitY()},
                                         {4, Vec3d::UnitY()},  {5, -Vec3d::UnitX()}, {6, -Vec3d::UnitX()},
                                         {7, Vec3d::UnitX()},  {8, Vec3d::UnitX()}};
  for (const auto& [orientation, up] : cases) {
    SourceCapture source;
    for (int i = 0; i < 12; ++i) {  // an orbit
      Photo photo;
      const double angle = i * M_PI / 6;
      Mat3d& rotation = photo.worldFromCamera.rotation;
      rotation.col(2) = Vec3d(-std::cos(angle), -std::sin(angle), 0);
      rotation.col(1) = -Vec3d::UnitZ();
      rotation.col(0) = rotation.col(1).cross(rotation.col(2));
      // The camera is held so that `up` of its picture points up.
      rotation = rotation * Eigen::Quaterniond::FromTwoVectors(up, Vec3d(-Vec3d::UnitY())).toRotationMatrix();
      photo.worldFromCamera.translation = Vec3d(5 * std::cos(angle), 5 * std::sin(angle), 1);
      source.capture.photos.push_back(photo);
    }
    scramble(source);
    orientWorld(source, std::vector<UprightTags>(12, {std::nullopt, orientation}));
    for (const Photo& photo : source.capture.photos)
      EXPECT_NEAR((photo.worldFromCamera.rotation * up - Vec3d::UnitZ()).norm(), 0, 1e-9) << orientation;
  }
}

TEST(Orient, LeavesOurOwnCapturesUnchanged) {
  SourceCapture source = flight();
  source.isOurs = true;
  const Pose before = source.capture.photos[3].worldFromCamera;
  orientWorld(source, {});
  EXPECT_EQ(source.capture.photos[3].worldFromCamera.translation, before.translation);
  EXPECT_EQ(source.capture.photos[3].worldFromCamera.rotation, before.rotation);
}

}  // namespace
}  // namespace tessera
