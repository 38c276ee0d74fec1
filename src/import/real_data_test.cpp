// Tests on real photographs. They are not part of the project: TESSERA_SHARED_DATA names the folder that contains them.
#include <gtest/gtest.h>

#include <algorithm>

#include "base/order_statistics.h"
#include "base/testing/shared_data.h"
#include "import/capture_reader.h"
#include "import/importer.h"
#include "import/testing/test_support.h"

namespace tessera {
namespace {

TEST(RealData, ImportsFoxWithoutItsSeventeenMissingPhotos) {
  SKIP_WITHOUT_SHARED_DATA("fox");
  const fs::path fox = sharedData("fox");
  const TemporaryFolder folder;
  testing::internal::CaptureStderr();
  const Capture capture = importCapture(fox, folder / "out", {.downscale = 8});
  const std::string warnings = testing::internal::GetCapturedStderr();
  EXPECT_NE(warnings.find("17 photos named by the source are not on disk"), std::string::npos) << warnings;
  EXPECT_EQ(warnings.find("unknown"), std::string::npos) << warnings;
  EXPECT_EQ(capture.photos.size(), 50u);
  EXPECT_EQ(capture.photosIn(Split::test).size(), 7u);
  ASSERT_EQ(capture.cameras.size(), 1u);
  EXPECT_EQ(capture.cameras[0].width, 68);  // 540 / 8, rounded
  EXPECT_EQ(capture.cameras[0].height, 120);
  EXPECT_EQ(capture.cameras[0].lens, LensModel::openCv);
  EXPECT_NEAR(capture.cameras[0].focalX(), 687.76 * 68 / 540, 1e-9);

  // Hand-held photos: every camera looks inwards and is upright.
  for (const Photo& photo : capture.photos) {
    EXPECT_GT(-photo.worldFromCamera.rotation.col(1).z(), 0.7) << photo.name;
    EXPECT_NEAR(photo.worldFromCamera.rotation.determinant(), 1, 1e-9);
  }
  EXPECT_EQ(readCapture(folder / "out").photos.size(), 50u);
}

TEST(RealData, BrightonBeachLooksDownFromAFlightAndItsPointsProjectBack) {
  SKIP_WITHOUT_SHARED_DATA("brighton_beach");
  const fs::path beach = sharedData("brighton_beach");
  const TemporaryFolder folder;
  const Capture capture = importCapture(beach, folder / "out", {.downscale = 8});
  ASSERT_EQ(capture.photos.size(), 18u);
  EXPECT_EQ(capture.photosIn(Split::test).size(), 3u);
  ASSERT_TRUE(capture.geo.has_value());

  // Checks poses, lens, axes and scaling together: the points project to their observations.
  ASSERT_GT(capture.observations.size(), 1000u);
  std::vector<double> errors, stored;
  for (const Observation& observation : capture.observations) {
    const Photo& photo = capture.photos[observation.photo];
    const auto pixel = capture.cameras[static_cast<size_t>(photo.camera)].pixelFromCamera(
        photo.worldFromCamera.inverse() * capture.points[observation.point].xInWorld);
    ASSERT_TRUE(pixel.has_value());
    errors.push_back((*pixel - Vec2d(observation.x, observation.y)).norm() * 8);
    stored.push_back(observation.error * 8);
  }
  EXPECT_LT(upperMedian(errors), 1.0);
  EXPECT_NEAR(upperMedian(stored), upperMedian(errors), 0.02);

  // The exposures of EXIF, against their mean.
  double sum = 0, least = 1e9, greatest = -1e9;
  for (const Photo& photo : capture.photos) {
    ASSERT_TRUE(photo.exposure.has_value());
    sum += *photo.exposure;
    least = std::min(least, *photo.exposure);
    greatest = std::max(greatest, *photo.exposure);
  }
  EXPECT_NEAR(sum, 0, 1e-9);
  EXPECT_GT(greatest - least, 0.1);
  EXPECT_LT(greatest - least, 6);

  // A nadir flight at one height, in metres: the drone recorded 40 m above take-off.
  double lowest = 1e9, highest = -1e9, ground = 0;
  for (const Photo& photo : capture.photos) {
    EXPECT_LT(photo.worldFromCamera.rotation.col(2).z(), -0.98) << photo.name;
    ASSERT_TRUE(photo.gps.has_value());
    EXPECT_NEAR(photo.gps->relativeAltitude, 40, 2);
    lowest = std::min(lowest, photo.worldFromCamera.translation.z());
    highest = std::max(highest, photo.worldFromCamera.translation.z());
  }
  EXPECT_LT(highest - lowest, 4);
  for (const SparsePoint& point : capture.points)
    ground += point.xInWorld.z() / static_cast<double>(capture.points.size());
  EXPECT_NEAR(lowest - ground, 40, 12);
}

TEST(RealData, ReadsBrightonBeachBackExactly) {
  SKIP_WITHOUT_SHARED_DATA("brighton_beach");
  const fs::path beach = sharedData("brighton_beach");
  const TemporaryFolder folder;
  const Capture written = importCapture(beach, folder / "out", {.downscale = 16});
  const Capture read = readCapture(folder / "out");
  ASSERT_EQ(read.photos.size(), written.photos.size());
  EXPECT_EQ(read.cameras, written.cameras);
  for (size_t i = 0; i < read.photos.size(); ++i) {
    EXPECT_EQ(read.photos[i].name, written.photos[i].name);
    EXPECT_EQ(read.photos[i].worldFromCamera.rotation, written.photos[i].worldFromCamera.rotation);
    EXPECT_EQ(read.photos[i].worldFromCamera.translation, written.photos[i].worldFromCamera.translation);
    EXPECT_EQ(read.photos[i].gps->latitude, written.photos[i].gps->latitude);
  }
  EXPECT_EQ(read.sourceFromWorld, written.sourceFromWorld);
  EXPECT_EQ(read.geo->enuFromWorld, written.geo->enuFromWorld);
  ASSERT_EQ(read.points.size(), written.points.size());
  EXPECT_EQ(read.points.back().xInWorld, written.points.back().xInWorld);
  ASSERT_EQ(read.observations.size(), written.observations.size());
  EXPECT_EQ(read.observations.back().x, written.observations.back().x);
}

}  // namespace
}  // namespace tessera
