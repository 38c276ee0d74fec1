#include "photogrammetry/photo_footprints.h"

#include <gtest/gtest.h>

#include "photogrammetry/testing/survey_list.h"

namespace tessera {
namespace {

TEST(PhotoFootprints, AreAsLargeAsHeightAndLensTell) {
  const PhotoList list = survey(3, 4, 15);
  const std::vector<PhotoFootprint> prints = photoFootprints(list, tellPlaces(list));
  ASSERT_EQ(prints.size(), 12u);
  const PhotoFootprint& print = prints.front();  // of 76 × 57 m, whose longer side is along the line
  const Vec2d middle = print.eye.head<2>();
  EXPECT_NEAR(print.eye.z(), 60, 1e-9);
  EXPECT_TRUE(print.shows(middle + Vec2d(27, 37)));
  EXPECT_FALSE(print.shows(middle + Vec2d(29.5, 0)));
  EXPECT_FALSE(print.shows(middle + Vec2d(0, 39)));
}

TEST(CaptureFromTags, HasThePosesThatTagsTell) {
  const PhotoList list = survey(3, 4, 15);
  const auto capture = captureFromTags(list);
  ASSERT_TRUE(capture.has_value());
  ASSERT_EQ(capture->photos.size(), 12u);
  ASSERT_EQ(capture->cameras.size(), 1u);
  EXPECT_EQ(capture->cameras[0].focalX(), 628);
  EXPECT_EQ(capture->cameras[0].centreY(), 300);
  EXPECT_TRUE(capture->geo.has_value());
  EXPECT_GT(capture->points.size(), 100u);
  for (const SparsePoint& point : capture->points) EXPECT_EQ(point.xInWorld.z(), 0);
  for (size_t i = 0; i < 12; ++i) {
    const Photo& photo = capture->photos[i];
    EXPECT_NEAR(photo.worldFromCamera.rotation(2, 2), -1, 1e-9) << "it looks down";
    EXPECT_NEAR(photo.worldFromCamera.translation.z(), 60, 1e-9);
    EXPECT_EQ(photo.gps->relativeAltitude, photo.worldFromCamera.translation.z()) << "the ground is at 0";
  }
  const Vec3d line = capture->photos[3].worldFromCamera.translation - capture->photos[0].worldFromCamera.translation;
  EXPECT_NEAR(line.x(), 45, 0.1);
  EXPECT_NEAR(line.y(), 0, 0.1);
}

TEST(CaptureFromTags, GuessesHeightsFromDistances) {
  PhotoList list = survey(4, 4, 20);
  for (ListedPhoto& photo : list.photos) photo.tags.gps->relativeAltitude = 0;
  const auto capture = captureFromTags(list);
  ASSERT_TRUE(capture.has_value());
  for (const Photo& photo : capture->photos) {
    EXPECT_GT(photo.worldFromCamera.translation.z(), 60);  // footprints of 57 m for 60 m of height
    EXPECT_LT(photo.worldFromCamera.translation.z(), 180);
    EXPECT_EQ(photo.gps->relativeAltitude, photo.worldFromCamera.translation.z());
  }
}

TEST(CaptureFromTags, IsOfThePhotosWhosePlacesAreKnown) {
  PhotoList list = survey(2, 4, 15);
  for (size_t i = 0; i < 4; ++i) list.photos[i].tags.gps.reset();
  const auto half = captureFromTags(list);
  ASSERT_TRUE(half.has_value());
  EXPECT_EQ(half->photos.size(), 4u);
  list.photos[4].tags.gps.reset();
  EXPECT_FALSE(captureFromTags(list).has_value()) << "of fewer than half of them";
  EXPECT_FALSE(captureFromTags(survey(1, 2, 15)).has_value()) << "two";
  EXPECT_FALSE(captureFromTags(PhotoList{}).has_value());
}

TEST(CaptureFromTags, IsOfTheLargestOfSeveralPlaces) {
  PhotoList list = survey(3, 4, 15);
  for (ListedPhoto& photo : survey(2, 4, 15).photos) {
    photo.tags.gps->longitude += 90;
    list.photos.insert(list.photos.begin(), photo);
  }
  const auto capture = captureFromTags(list);
  ASSERT_TRUE(capture.has_value());
  EXPECT_EQ(capture->photos.size(), 12u);
}

}  // namespace
}  // namespace tessera
