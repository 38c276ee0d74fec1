#include "train/scene_frame.h"

#include <gtest/gtest.h>

#include "base/random.h"

namespace tessera {
namespace {

// A camera at `from` that looks at `to`.
Photo lookingAt(const Vec3d& from, const Vec3d& to) {
  Photo photo;
  const Vec3d forward = (to - from).normalized();
  const Vec3d right = forward.cross(Vec3d(0.1, 0.2, 1).normalized()).normalized();
  photo.worldFromCamera.rotation.col(0) = right;
  photo.worldFromCamera.rotation.col(1) = forward.cross(right);
  photo.worldFromCamera.rotation.col(2) = forward;
  photo.worldFromCamera.translation = from;
  return photo;
}

Capture orbit(const Vec3d& centre, double radius) {
  Capture capture;
  for (int i = 0; i < 12; ++i) {
    const double angle = i * 0.5236;
    capture.photos.push_back(
        lookingAt(centre + radius * Vec3d(std::cos(angle), std::sin(angle), i % 2 ? 0.3 : 0.6), centre));
  }
  return capture;
}

void addPoints(Capture& capture, int count, const Vec3d& low, const Vec3d& high) {
  const RandomStream random(1, 2);
  for (int i = 0; i < count; ++i) {
    SparsePoint point;
    for (int axis = 0; axis < 3; ++axis) {
      point.xInWorld[axis] = low[axis] + (high - low)[axis] * random.uniformDouble(3 * i + axis);
    }
    capture.points.push_back(point);
  }
}

TEST(SceneFrame, CoversTheRobustBoundsOfManyPoints) {
  Capture capture = orbit({0, 0, 0}, 500);
  addPoints(capture, 5000, {100, 40, -10}, {300, 80, 20});
  const SceneFrame frame = fitSceneFrame(capture, 1);
  EXPECT_NEAR(frame.centre.x(), 200, 4);
  EXPECT_NEAR(frame.centre.y(), 60, 2);
  EXPECT_NEAR(frame.centre.z(), 5, 2);
  EXPECT_NEAR(frame.scale, 1.0 / 96, 1.0 / 96 / 20);  // 2nd to 98th percentile of the longest side
}

TEST(SceneFrame, IsNotMovedByAFewPointsFarAway) {
  Capture capture = orbit({0, 0, 0}, 500);
  addPoints(capture, 5000, {-1, -1, -1}, {1, 1, 1});
  const SceneFrame before = fitSceneFrame(capture, 1);
  addPoints(capture, 50, {1e6, 1e6, 1e6}, {2e6, 2e6, 2e6});
  const SceneFrame after = fitSceneFrame(capture, 1);
  EXPECT_LT((before.centre - after.centre).norm(), 0.1);
  EXPECT_NEAR(after.scale, before.scale, 0.1 * before.scale);
}

TEST(SceneFrame, IsCentredWhereTheCamerasLookWithoutPoints) {
  for (const Vec3d& centre : {Vec3d(0, 0, 0), Vec3d(300, -200, 10)}) {
    const Capture capture = orbit(centre, 20);
    const SceneFrame frame = fitSceneFrame(capture, 1);
    EXPECT_LT((frame.centre - centre).norm(), 0.5);
    double farthest = 0;
    for (const Photo& photo : capture.photos) {
      farthest = std::max(farthest, frame.sceneFromWorld(photo.worldFromCamera.translation).lpNorm<Eigen::Infinity>());
    }
    EXPECT_NEAR(farthest, 1, 1e-9);  // the farthest camera lies on the border
  }
}

TEST(SceneFrame, IgnoresACameraFarAwayWithoutPoints) {
  Capture capture = orbit({300, -200, 10}, 20);
  const SceneFrame before = fitSceneFrame(capture, 1);
  capture.photos.insert(capture.photos.begin() + 3, lookingAt({1e9, 2e9, -1e9}, {0, 0, 0}));
  capture.photos[3].name = "stray.jpg";
  testing::internal::CaptureStderr();
  const SceneFrame after = fitSceneFrame(capture, 1);
  const std::string warnings = testing::internal::GetCapturedStderr();
  EXPECT_EQ(after.centre, before.centre);
  EXPECT_EQ(after.scale, before.scale);
  EXPECT_NE(warnings.find("1 photos stand"), std::string::npos) << warnings;
  EXPECT_NE(warnings.find("stray.jpg"), std::string::npos) << warnings;
}

TEST(SceneFrame, IncludesModeratelyDistantCamerasWithoutPoints) {
  Capture capture = orbit({0, 0, 0}, 20);
  for (const Vec3d& from : {Vec3d(0, 0, 150), Vec3d(10, 0, 160)}) capture.photos.push_back(lookingAt(from, {0, 0, 1}));
  for (int i = 0; i < 40; ++i) capture.photos.push_back(lookingAt({1, 2, 3}, {0.1 * i, 0, 0}));  // on a tripod
  const SceneFrame frame = fitSceneFrame(capture, 1);
  EXPECT_NEAR(frame.sceneFromWorld({10, 0, 160}).lpNorm<Eigen::Infinity>(), 1, 1e-9);
}

TEST(SceneFrame, IsFiniteForCamerasWithParallelAxes) {
  Capture capture;
  for (int i = 0; i < 5; ++i) capture.photos.push_back(lookingAt(Vec3d(i, 0, 30), Vec3d(i, 0, 0)));
  const SceneFrame frame = fitSceneFrame(capture, 1);
  EXPECT_TRUE(frame.centre.allFinite());
  EXPECT_LT((frame.centre - Vec3d(2, 0, 30)).norm(), 100);
  EXPECT_GT(frame.scale, 0);
  EXPECT_TRUE(std::isfinite(frame.scale));
}

TEST(SceneFrame, IsFiniteForASingleCamera) {
  Capture capture;
  capture.photos.push_back(lookingAt({1, 2, 3}, {4, 5, 6}));
  const SceneFrame frame = fitSceneFrame(capture, 1);
  EXPECT_TRUE(frame.centre.allFinite());
  EXPECT_TRUE(std::isfinite(frame.scale));
}

TEST(SceneFrame, GrowsWithItsMargin) {
  const Capture capture = orbit({1, 2, 3}, 20);
  const SceneFrame tight = fitSceneFrame(capture, 1), wide = fitSceneFrame(capture, 2);
  EXPECT_EQ(tight.centre, wide.centre);
  EXPECT_NEAR(wide.scale, tight.scale / 2, 1e-12);
}

TEST(SceneFrame, PlacesRayCamerasInSceneUnits) {
  const SceneFrame frame{{100, 200, 300}, 0.5};
  Camera camera;
  camera.lens = LensModel::openCvFisheye;
  camera.parameters = {10, 11, 12, 13, 0.1, 0.2, 0.3, 0.4};
  const Photo photo = lookingAt({102, 204, 306}, {1, 1, 1});
  const RayCamera rayCamera = makeRayCamera(camera, photo.worldFromCamera, frame);
  EXPECT_EQ(rayCamera.lens, static_cast<int>(LensModel::openCvFisheye));
  for (int i = 0; i < 16; ++i) EXPECT_EQ(rayCamera.parameters[i], static_cast<float>(camera.parameters[i]));
  for (int i = 0; i < 3; ++i) EXPECT_FLOAT_EQ(rayCamera.centre[i], static_cast<float>(i + 1));
  for (int i = 0; i < 9; ++i)
    EXPECT_FLOAT_EQ(rayCamera.rotation[i], static_cast<float>(photo.worldFromCamera.rotation(i / 3, i % 3)));
}

}  // namespace
}  // namespace tessera
