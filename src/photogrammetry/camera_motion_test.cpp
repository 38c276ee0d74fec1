#include "photogrammetry/camera_motion.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "base/random.h"

namespace tessera {
namespace {

constexpr int kWidth = 800, kHeight = 600;

struct View {
  Eigen::Vector3d place;
  double degrees;  // by which it is turned about the vertical axis
};

// A model of points that these views show with the given focal length in pixels, and with errors of 0.3 pixels.
// `depth`: of point i.
ColmapModel makeModel(const std::vector<View>& views, double focalLength, double (*depth)(double)) {
  ColmapModel model;
  Camera camera;
  camera.width = kWidth;
  camera.height = kHeight;
  model.cameras[1] = camera;
  const RandomStream random(1, 2);
  std::vector<Eigen::Vector3d> points;
  for (uint64_t i = 0; i < 3000; ++i) {
    const double far = depth(random.uniformDouble(3 * i));
    points.push_back({far * 2.5 * (random.uniformDouble(3 * i + 1) - 0.5),
                      far * 1.5 * (random.uniformDouble(3 * i + 2) - 0.5), far});
  }
  uint64_t drawn = 1 << 20;
  for (size_t v = 0; v < views.size(); ++v) {
    ColmapModel::Image image;
    image.id = static_cast<uint32_t>(v + 1);
    image.camera = 1;
    const Eigen::AngleAxisd turn(views[v].degrees * 3.14159265358979 / 180, Eigen::Vector3d::UnitY());
    for (size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d seen = turn.inverse() * (points[i] - views[v].place);
      const auto noise = [&] { return 0.3 * 2 * (random.uniformDouble(drawn++) - 0.5); };
      const double x = kWidth / 2 + focalLength * seen.x() / seen.z() + noise(),
                   y = kHeight / 2 + focalLength * seen.y() / seen.z() + noise();
      if (seen.z() > 0 && x > 0 && x < kWidth && y > 0 && y < kHeight) image.keypoints.push_back({x, y, i + 1});
    }
    model.images.push_back(image);
  }
  return model;
}

double alike(double) {
  return 50;
}
double different(double random) {
  return 30 + 40 * random;
}

TEST(CameraMotion, IsATurnIfAllPhotosAreFromOneStop) {
  for (const double focalLength : {500.0, 900.0, 1900.0}) {
    for (const auto depth : {alike, different}) {
      EXPECT_TRUE(
          onlyTurns(makeModel({{{0, 0, 0}, -5}, {{0, 0, 0}, -2}, {{0, 0, 0}, 1}, {{0, 0, 0}, 5}}, focalLength, depth)))
          << focalLength;
    }
  }
}

// As of a drone that looks straight down.
TEST(CameraMotion, IsMoreThanATurnAboveFlatGround) {
  for (const double focalLength : {500.0, 900.0, 1900.0}) {
    const double step = 50 * 0.25 * kWidth / focalLength;  // an overlap of three quarters
    EXPECT_FALSE(onlyTurns(makeModel({{{0, 0, 0}, 0}, {{step, 0, 0}, 0}, {{2 * step, 0, 0}, 0}}, focalLength, alike)))
        << focalLength;
  }
}

TEST(CameraMotion, IsMoreThanATurnIfTheCameraMovesBeforeThingsAtDifferentDistances) {
  EXPECT_FALSE(onlyTurns(makeModel({{{0, 0, 0}, 0}, {{1, 0, 0}, 1}, {{2, 0, 0}, 2}}, 900, different)));
  EXPECT_FALSE(onlyTurns(makeModel({{{0, 0, 0}, 0}, {{0, 0, 2}, 0}, {{0, 0, 4}, 0}}, 900, different))) << "forwards";
}

TEST(CameraMotion, IsUnknownWithoutSharedPoints) {
  EXPECT_FALSE(onlyTurns({}));
  EXPECT_FALSE(onlyTurns(makeModel({{{0, 0, 0}, 0}, {{0, 0, 0}, 180}}, 900, alike)));
}

}  // namespace
}  // namespace tessera
