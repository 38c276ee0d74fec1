#include "train/sparse_depth.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tessera {
namespace {

// A photo of 100 × 80 pixels that looks from the origin along +z, one that is not trained on, and one without
// observations.
Capture threePhotos() {
  Capture capture;
  Camera camera;
  camera.width = 100;
  camera.height = 80;
  capture.cameras.push_back(camera);
  capture.photos.resize(3);
  capture.photos[1].split = Split::test;
  return capture;
}

void observe(Capture& capture, uint32_t photo, const Vec3d& point, float x, float y, float error = 0.5f) {
  capture.observations.push_back({photo, static_cast<uint32_t>(capture.points.size()), x, y, error});
  capture.points.push_back({point, {}, 0.3f});
}

TEST(SparseDepths, AreDistancesFromTheCameraInSceneUnits) {
  Capture capture = threePhotos();
  capture.photos[0].worldFromCamera.translation = Vec3d(0, 0, -1);
  observe(capture, 0, Vec3d(3, 0, 3), 17.9f, 40.2f);
  SceneFrame frame;
  frame.scale = 0.5;
  const auto known = findSparseDepths(capture, frame, 2);
  ASSERT_EQ(known.size(), 3u);
  ASSERT_EQ(known[0].size(), 1u);
  EXPECT_EQ(known[0][0].x, 17u);
  EXPECT_EQ(known[0][0].y, 40u);
  EXPECT_FLOAT_EQ(known[0][0].distance, 2.5f);
  EXPECT_TRUE(known[2].empty());
}

TEST(SparseDepths, IncludePointsBehindTheImagePlaneOfAFisheye) {
  Capture capture = threePhotos();
  capture.cameras[0].lens = LensModel::openCvFisheye;
  observe(capture, 0, Vec3d(4, 0, -3), 95, 40);
  const auto known = findSparseDepths(capture, SceneFrame(), 2);
  ASSERT_EQ(known[0].size(), 1u);
  EXPECT_FLOAT_EQ(known[0][0].distance, 5);
}

TEST(SparseDepths, ExcludeUnreliableObservations) {
  Capture capture = threePhotos();
  observe(capture, 0, Vec3d(0, 0, 2), 50, 40, 2.5f);  // too large an error
  observe(capture, 0, Vec3d(0, 0, 2), 50, 40, std::nanf(""));
  observe(capture, 0, Vec3d(0, 0, -2), 50, 40);  // behind the camera
  observe(capture, 0, Vec3d(0, 0, 2), 100, 40);  // outside the photo
  observe(capture, 0, Vec3d(0, 0, 2), 50, -0.5f);
  observe(capture, 0, Vec3d(0, 0, 2), std::nanf(""), 40);
  observe(capture, 1, Vec3d(0, 0, 2), 50, 40);  // held out
  for (const auto& photo : findSparseDepths(capture, SceneFrame(), 2)) EXPECT_TRUE(photo.empty());
}

TEST(SparseDepthMedians, AreTakenOverTheCellOfThePhoto) {
  Capture capture = threePhotos();
  for (const double depth : {2.0, 3.0, 10.0}) observe(capture, 0, Vec3d(0, 0, depth), 50.5f, 40.5f);
  const SparseDepthMedians depths(capture, 2);
  EXPECT_FLOAT_EQ(static_cast<float>(depths(0, {51.0, 41.0})), 3);
  EXPECT_EQ(depths(0, {70.0, 41.0}), 0) << "nothing is known there";
  EXPECT_EQ(depths(0, {-1.0, 500.0}), 0) << "beside the photo";
  EXPECT_EQ(depths(1, {51.0, 41.0}), 0) << "not trained on";
}

}  // namespace
}  // namespace tessera
