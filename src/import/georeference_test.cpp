#include "import/georeference.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"
#include "import/orient_world.h"
#include "import/testing/flights.h"

namespace tessera {
namespace {

TEST(Georeference, ToleratesNoiseAndAThirdOfWildFixes) {
  SourceCapture source = flight(3);
  for (int i : {2, 5, 8, 11, 13, 17})
    source.capture.photos[static_cast<size_t>(i)].gps->latitude += 0.01;  // a kilometre
  scramble(source);
  std::string reason;
  const auto fit = georeference(source.capture.photos, {}, reason);
  ASSERT_TRUE(fit.has_value()) << reason;
  EXPECT_EQ(fit->inliers, 14);
  EXPECT_LT(fit->rmsMetres, 2);
  orientWorld(source, {});
  for (const Photo& photo : source.capture.photos) EXPECT_LT(photo.worldFromCamera.rotation.col(2).z(), -0.99);
}

TEST(Georeference, LeavesFixesWithoutAltitudeOutIfMostHaveOne) {
  SourceCapture source = flight();
  for (const size_t i : {2u, 5u, 8u}) {
    source.capture.photos[i].gps->altitude = 0;
    source.capture.photos[i].gps->hasAltitude = false;
  }
  scramble(source);
  std::string reason;
  const auto fit = georeference(source.capture.photos, {}, reason);
  ASSERT_TRUE(fit.has_value()) << reason;
  EXPECT_TRUE(fit->hasAltitudes);
  EXPECT_EQ(fit->fixes, 17);
  EXPECT_EQ(fit->inliers, 17);
  EXPECT_NEAR(fit->frame.altitude, 161.5, 1);
}

TEST(Georeference, TellsThatNoAltitudeIsKnown) {
  SourceCapture source = flight();
  for (Photo& photo : source.capture.photos) {
    photo.gps->altitude = 0;
    photo.gps->hasAltitude = false;
  }
  source.capture.photos[3].gps->altitude = 160;
  source.capture.photos[3].gps->hasAltitude = true;  // alone, it says nothing of the others
  scramble(source);
  std::string reason;
  const auto fit = georeference(source.capture.photos, {}, reason);
  ASSERT_TRUE(fit.has_value()) << reason;
  EXPECT_FALSE(fit->hasAltitudes);
  EXPECT_EQ(fit->inliers, 20);
  EXPECT_EQ(fit->frame.altitude, 0);
  testing::internal::CaptureStderr();
  orientWorld(source, {});
  EXPECT_NE(testing::internal::GetCapturedStderr().find("GPS states no altitudes"), std::string::npos);
}

// Twenty photos of three flights, of which the second is at another height and 15 m too high by its GPS.
TEST(Georeference, CorrectsTheHeightsOfAFlight) {
  SourceCapture source = flight(0.5);
  for (size_t i = 0; i < 20; ++i) {
    source.flight.push_back(i < 6 ? 0 : i < 14 ? 1 : 2);
    Photo& photo = source.capture.photos[i];
    if (source.flight.back() != 1) continue;
    photo.worldFromCamera.translation.z() += 40;
    photo.gps->altitude += 40 + 15;
  }
  scramble(source);
  std::string reason;
  const auto fit = georeference(source.capture.photos, source.flight, reason);
  ASSERT_TRUE(fit.has_value()) << reason;
  EXPECT_EQ(fit->inliers, 20);
  ASSERT_EQ(fit->heightsTooHigh.size(), 3u);
  EXPECT_EQ(fit->heightsTooHigh[0], 0);
  EXPECT_NEAR(fit->heightsTooHigh[1], 15, 2);
  EXPECT_EQ(fit->heightsTooHigh[2], 0);
  orientWorld(source, {});
  expectEastNorthUp(source.capture, 1.5);
}

// Heights that are free for each of many flights side by side would let the world tilt.
TEST(Georeference, CorrectsNoFlightWithoutAnError) {
  SourceCapture source;
  const RandomStream random(11, 1);
  uint64_t draw = 0;
  const GeographicLib::LocalCartesian local(50, 8, 100);
  for (int strip = 0; strip < 8; ++strip) {
    for (int i = 0; i < 20; ++i) {
      Photo photo;
      const Vec3d at(40.0 * strip, 20.0 * i, 60);  // each flight is a line
      photo.worldFromCamera = nadirPose(at, 0);
      GpsFix fix;
      const auto noise = [&] { return 6 * (random.uniformDouble(draw++) - 0.5); };
      const double x = at.x() + noise(), y = at.y() + noise(), z = at.z() + noise();
      local.Reverse(x, y, z, fix.latitude, fix.longitude, fix.altitude);
      photo.gps = fix;
      source.capture.photos.push_back(photo);
      source.flight.push_back(strip);
    }
  }
  scramble(source);
  std::string reason;
  const auto fit = georeference(source.capture.photos, source.flight, reason);
  ASSERT_TRUE(fit.has_value()) << reason;
  EXPECT_EQ(fit->inliers, 160);
  for (const double height : fit->heightsTooHigh) EXPECT_EQ(height, 0);
  orientWorld(source, {});
  for (const Photo& photo : source.capture.photos)
    EXPECT_GT(-photo.worldFromCamera.rotation.col(2).z(), std::cos(0.3 * M_PI / 180))
        << "tilted by more than the noise of 1.7 m over 100 m explains";
}

// The error is that of the flight with fewer fixes.
TEST(Georeference, KeepsTheAltitudesOfTheLargerOfTwoFlights) {
  SourceCapture source = flight();
  for (size_t i = 0; i < 20; ++i) {
    source.flight.push_back(i < 8 ? 0 : 1);
    if (i < 8) source.capture.photos[i].gps->altitude -= 15;
  }
  scramble(source);
  std::string reason;
  const auto fit = georeference(source.capture.photos, source.flight, reason);
  ASSERT_TRUE(fit.has_value()) << reason;
  ASSERT_EQ(fit->heightsTooHigh.size(), 2u);
  EXPECT_NEAR(fit->heightsTooHigh[0], -15, 0.1);
  EXPECT_EQ(fit->heightsTooHigh[1], 0);
}

// Surveys of 7 × 8 photos at two heights, with normally distributed errors of GPS of 2 m, and 0.5 m in height.
class NoisySurvey {
 public:
  // `hasBarometer`: heights above take-off are right within 0.5 m, absolute ones only within 3 m.
  explicit NoisySurvey(uint64_t seed, bool hasBarometer = false) : random_(seed, 5) {
    const GeographicLib::LocalCartesian local(50, 8, 100);
    for (int i = 0; i < 56; ++i) {
      Photo photo;
      const Vec3d at(30.0 * (i % 7), 25.0 * static_cast<int>(i / 7), i % 2 == 0 ? 60 : 100);
      photo.worldFromCamera = nadirPose(at, 0);
      GpsFix fix;
      const double x = at.x() + 2 * normal(), y = at.y() + 2 * normal(), z = at.z() + 0.5 * normal();
      local.Reverse(x, y, z, fix.latitude, fix.longitude, fix.altitude);
      if (hasBarometer) {
        fix.relativeAltitude = z - 20;
        fix.altitude += at.z() - z + 3 * normal();
      }
      photo.gps = fix;
      source.capture.photos.push_back(photo);
    }
  }
  // Lifts the poses by so many metres at the farthest photos from the middle, as the square of the distance.
  void bend(double metres) {
    for (Photo& photo : source.capture.photos) {
      Vec3d& at = photo.worldFromCamera.translation;
      at.z() += metres * (at.head<2>() - Vec2d(90, 87.5)).squaredNorm() / Vec2d(90, 87.5).squaredNorm();
    }
  }
  Georeference fit() {
    scramble(source);
    std::string reason;
    const auto georeferenced = georeference(source.capture.photos, {}, reason);
    EXPECT_TRUE(georeferenced.has_value()) << reason;
    return georeferenced.value_or(Georeference{});
  }

  SourceCapture source;

 private:
  double normal() {  // by the central limit theorem
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += random_.uniformDouble(draw_++);
    return sum;
  }

  RandomStream random_;
  uint64_t draw_ = 0;
};

class ErrorsOfGeoreferences : public testing::TestWithParam<bool> {};

TEST_P(ErrorsOfGeoreferences, ArePredicted) {
  constexpr int kTrials = 100;
  double scale = 0, rotation = 0, middle = 0, predictedScale = 0, predictedRotation = 0, predictedMiddle = 0;
  double horizontal = 0, vertical = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    NoisySurvey survey(static_cast<uint64_t>(trial) + 1, GetParam());
    const Mat3d trueRotation = survey.source.capture.photos[0].worldFromCamera.rotation;
    const Georeference fit = survey.fit();
    EXPECT_EQ(fit.residuals.size(), 56u);
    const Capture& capture = survey.source.capture;
    const Mat3d linear = fit.frame.enuFromWorld.topLeftCorner<3, 3>();
    const double metres = std::cbrt(linear.determinant());
    scale += std::pow(metres * 0.07 - 1, 2);
    const Mat3d turned = linear / metres * capture.photos[0].worldFromCamera.rotation;
    rotation += std::pow(Eigen::AngleAxisd(turned * trueRotation.transpose()).angle() * 180 / M_PI, 2);
    // The frame's origin is the mean of the fixes: its place on the first survey's plane is that of the noise.
    Vec3d sum = Vec3d::Zero();
    for (const Photo& photo : capture.photos)
      sum += (fit.frame.enuFromWorld * photo.worldFromCamera.translation.homogeneous()).head<3>();
    const GeographicLib::LocalCartesian local(50, 8, 100);
    Vec3d origin;
    local.Forward(fit.frame.latitude, fit.frame.longitude, fit.frame.altitude, origin.x(), origin.y(), origin.z());
    middle += (sum / 56 + origin - Vec3d(90, 87.5, 80)).squaredNorm();
    predictedScale += fit.scaleError * fit.scaleError;
    predictedRotation += fit.rotationError * fit.rotationError;
    predictedMiddle += fit.middleError * fit.middleError;
    horizontal += fit.horizontalDeviation / kTrials;
    vertical += fit.verticalDeviation / kTrials;
  }
  EXPECT_NEAR(horizontal, 2, 0.15);
  EXPECT_NEAR(vertical, 0.5, 0.05);
  EXPECT_NEAR(std::sqrt(scale / predictedScale), 1, 0.25);
  EXPECT_NEAR(std::sqrt(rotation / predictedRotation), 1, 0.25);
  EXPECT_NEAR(std::sqrt(middle / predictedMiddle), 1, 0.25);
}

INSTANTIATE_TEST_SUITE_P(Georeference, ErrorsOfGeoreferences, testing::Bool(),
                         [](const auto& test) { return test.param ? "WithABarometer" : "ByGpsAlone"; });

TEST(Georeference, SaysIfPosesBend) {
  for (uint64_t seed = 1; seed <= 40; ++seed) EXPECT_FALSE(NoisySurvey(seed).fit().isBent()) << seed;
  NoisySurvey dome(3);
  dome.bend(-3);
  const Georeference fit = dome.fit();
  EXPECT_TRUE(fit.isBent());
  ASSERT_TRUE(fit.bend.has_value());
  EXPECT_NEAR(fit.bend->metres, 3, 3 * fit.bend->error) << "fixes stand higher than poses far from the middle";
}

// The second flight took off 15 m higher: heights above take-off alone would be lower by half of that.
TEST(Georeference, TakesTheLevelFromAbsoluteAltitudes) {
  SourceCapture source = flight();
  for (size_t i = 0; i < 20; ++i) {
    source.flight.push_back(i < 8 ? 0 : 1);
    GpsFix& gps = *source.capture.photos[i].gps;
    gps.relativeAltitude = gps.altitude - 100 - (i < 8 ? 15 : 0);
  }
  scramble(source);
  std::string reason;
  const auto fit = georeference(source.capture.photos, source.flight, reason);
  ASSERT_TRUE(fit.has_value()) << reason;
  EXPECT_NEAR(fit->heightsTooHigh[0], -15, 0.1);
  const Vec3d first =
      (fit->frame.enuFromWorld * source.capture.photos[0].worldFromCamera.translation.homogeneous()).head<3>();
  EXPECT_NEAR(first.z() + fit->frame.altitude, 160, 0.05);
}

// Five flights one behind the other up a slope, each from a take-off 12 m higher: by their heights above take-off all
// are level, which a world tilted by 2.2 degrees fits to within a few metres.
SourceCapture flightsUpASlope(bool tellsFlights) {
  SourceCapture source;
  const GeographicLib::LocalCartesian local(50, 8, 100);
  for (int i = 0; i < 150; ++i) {
    const int flight = i / 30;
    Photo photo;
    const Vec3d at(10.0 * (i / 3) + 5, 30.0 * (i % 3), 80 + 12 * flight + i % 2);
    photo.worldFromCamera = nadirPose(at, 0);
    GpsFix fix;
    local.Reverse(at.x(), at.y(), at.z(), fix.latitude, fix.longitude, fix.altitude);
    fix.relativeAltitude = 80 + i % 2;
    photo.gps = fix;
    source.capture.photos.push_back(photo);
    if (tellsFlights) source.flight.push_back(flight);
  }
  return source;
}

TEST(Georeference, TakesAbsoluteAltitudesIfFlightsTookOffAtOtherHeights) {
  for (const bool tellsFlights : {true, false}) {
    SourceCapture source = flightsUpASlope(tellsFlights);
    scramble(source);
    // Of a phone, which tells no height.
    GpsFix& phone = *source.capture.photos[70].gps;
    phone.relativeAltitude = phone.altitude = 0;
    phone.hasAltitude = false;
    std::string reason;
    const auto fit = georeference(source.capture.photos, source.flight, reason);
    ASSERT_TRUE(fit.has_value()) << reason;
    EXPECT_TRUE(fit->ignoresTakeOff);
    EXPECT_EQ(fit->inliers, 149);
    orientWorld(source, {});
    for (const Photo& photo : source.capture.photos)
      EXPECT_GT(-photo.worldFromCamera.rotation.col(2).z(), std::cos(0.05 * M_PI / 180));
  }
}

// Absolute altitudes that jump from flight to flight, of flights from one place; also if some photos, as of a phone,
// state no height above take-off.
TEST(Georeference, KeepsHeightsAboveTakeOffIfAbsoluteAltitudesJump) {
  for (const size_t without : {0, 14, 30}) {
    SCOPED_TRACE(without);
    SourceCapture source = flightsUpASlope(true);
    for (size_t i = 0; i < 150; ++i) {
      GpsFix& gps = *source.capture.photos[i].gps;
      gps.relativeAltitude += 12.0 * static_cast<double>(i / 30);
      gps.altitude += i / 30 % 2 == 0 ? 2 : -2;
    }
    for (size_t k = 0; k < without; ++k) source.capture.photos[5 * k].gps->relativeAltitude = 0;
    scramble(source);
    std::string reason;
    const auto fit = georeference(source.capture.photos, source.flight, reason);
    ASSERT_TRUE(fit.has_value()) << reason;
    EXPECT_FALSE(fit->ignoresTakeOff);
    const bool usesTakeOff = without < 15;
    EXPECT_EQ(fit->fixes, usesTakeOff ? 150 - static_cast<int>(without) : 150);
    EXPECT_LT(fit->verticalDeviation, 0.1) << "flights are corrected";
  }
}

TEST(Georeference, WorksAcrossTheAntimeridian) {
  SourceCapture source = flight();
  for (Photo& photo : source.capture.photos) {
    photo.gps->longitude = std::remainder(photo.gps->longitude + 172 - 0.0005, 360);
    photo.gps->latitude -= 67;
  }
  const auto isWest = [](const Photo& photo) { return photo.gps->longitude < 0; };
  const auto west = std::count_if(source.capture.photos.begin(), source.capture.photos.end(), isWest);
  ASSERT_GT(west, 4);
  ASSERT_LT(west, 16);
  const double stretch =
      std::cos(17 * M_PI / 180) / std::cos(50 * M_PI / 180);  // a degree of longitude is longer there
  for (Photo& photo : source.capture.photos) photo.worldFromCamera.translation.x() *= stretch;
  scramble(source);
  std::string reason;
  const auto fit = georeference(source.capture.photos, {}, reason);
  ASSERT_TRUE(fit.has_value()) << reason;
  EXPECT_NEAR(std::abs(fit->frame.longitude), 180, 0.01);
  orientWorld(source, {});
  for (const Photo& photo : source.capture.photos) EXPECT_LT(photo.worldFromCamera.rotation.col(2).z(), -0.999);
}

TEST(Georeference, RejectsAStripDespiteAWildFix) {
  SourceCapture source;
  const GeographicLib::LocalCartesian local(50, 8, 100);
  const RandomStream random(11, 2);
  for (uint64_t i = 0; i < 20; ++i) {
    const auto noise = [&](uint64_t k, double size) { return size * (random.uniformDouble(8 * i + k) - 0.5); };
    Photo photo;
    const Vec3d at(5.0 * static_cast<double>(i), noise(0, 6), 60);
    photo.worldFromCamera = nadirPose(at, 0);
    GpsFix fix;
    local.Reverse(at.x() + noise(1, 4), at.y() + noise(2, 4) + (i == 7 ? 300 : 0), at.z() + noise(3, 2), fix.latitude,
                  fix.longitude, fix.altitude);
    photo.gps = fix;
    source.capture.photos.push_back(photo);
  }
  scramble(source);
  std::string reason;
  EXPECT_FALSE(georeference(source.capture.photos, {}, reason).has_value());
  EXPECT_NE(reason.find("of one line, too near"), std::string::npos) << reason;
}

TEST(Georeference, RejectsFixesThatDoNotDetermineARotation) {
  std::string reason;
  SourceCapture few = flight();
  for (size_t i = 2; i < few.capture.photos.size(); ++i) few.capture.photos[i].gps.reset();
  EXPECT_FALSE(georeference(few.capture.photos, {}, reason).has_value());
  EXPECT_EQ(reason, "2 photos with GPS; three are needed");

  SourceCapture line = flight();
  for (size_t i = 5; i < line.capture.photos.size(); ++i) line.capture.photos[i].gps.reset();
  for (size_t i = 0; i < 5; ++i) {
    line.capture.photos[i].worldFromCamera.translation.z() = 60;
    line.capture.photos[i].gps->altitude = 160;
  }
  EXPECT_FALSE(georeference(line.capture.photos, {}, reason).has_value());
  EXPECT_NE(reason.find("line"), std::string::npos) << reason;

  SourceCapture unrelated = flight();
  const RandomStream random(3, 3);
  uint64_t draw = 0;
  for (Photo& photo : unrelated.capture.photos) {
    photo.worldFromCamera.translation =
        Vec3d(random.uniformDouble(draw), random.uniformDouble(draw + 1), random.uniformDouble(draw + 2));
    draw += 3;
  }
  EXPECT_FALSE(georeference(unrelated.capture.photos, {}, reason).has_value());
}

}  // namespace
}  // namespace tessera
