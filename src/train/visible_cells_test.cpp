#include "train/visible_cells.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace tessera {
namespace {

// One photo at the world's origin that looks along +Y, with a field of view of 90 degrees in both directions.
Capture lookingAlongY() {
  Capture capture;
  Camera camera;
  camera.width = camera.height = 100;
  camera.parameters = {50, 50, 50, 50};
  capture.cameras.push_back(camera);
  Photo photo;
  photo.name = "a.png";
  photo.worldFromCamera.rotation.col(0) = Vec3d::UnitX();
  photo.worldFromCamera.rotation.col(1) = -Vec3d::UnitZ();
  photo.worldFromCamera.rotation.col(2) = Vec3d::UnitY();
  capture.photos.push_back(photo);
  return capture;
}

MarchSpace space(bool contracted) {
  MarchSpace marchSpace;
  marchSpace.contracted = contracted;
  marchSpace.gridResolution = 32;
  marchSpace.near = 0.05f;
  return marchSpace;
}

bool at(const std::vector<bool>& cells, const MarchSpace& space, const Vec3d& gridCoordinates) {
  const Eigen::Vector3i cell = (gridCoordinates * space.gridResolution).cast<int>();
  return cells[cell.x() + space.gridResolution * (cell.y() + space.gridResolution * cell.z())];
}

// Returns the grid coordinates of a point in the unit cube.
Vec3d inside(const MarchSpace& space, double x, double y, double z) {
  const Vec3d point(x, y, z);
  return space.contracted ? Vec3d((point + Vec3d::Constant(2)) / 4) : Vec3d((point + Vec3d::Ones()) / 2);
}

TEST(VisibleCells, AreThoseInFrontOfACameraAndInItsImage) {
  for (const bool contracted : {true, false}) {
    const MarchSpace march = space(contracted);
    const std::vector<bool> cells = visibleCells(lookingAlongY(), SceneFrame(), march);
    EXPECT_TRUE(at(cells, march, inside(march, 0.05, 0.8, 0.05)));
    EXPECT_TRUE(at(cells, march, inside(march, -0.4, 0.5, 0.4)));
    EXPECT_FALSE(at(cells, march, inside(march, 0.05, -0.8, 0.05)));  // behind the camera
    EXPECT_FALSE(at(cells, march, inside(march, 0.9, 0.2, 0.05)));    // outside the image
  }
}

TEST(VisibleCells, ReachToInfinityWhenContractedAndExcludeUnmappedCells) {
  const MarchSpace march = space(true);
  const std::vector<bool> cells = visibleCells(lookingAlongY(), SceneFrame(), march);
  EXPECT_TRUE(at(cells, march, Vec3d(0.51, 0.99, 0.51)));   // far ahead
  EXPECT_FALSE(at(cells, march, Vec3d(0.51, 0.01, 0.51)));  // far behind
  EXPECT_FALSE(at(cells, march, Vec3d(0.95, 0.95, 0.51)));  // two coordinates beyond 1
}

TEST(VisibleCells, FollowTheSceneFrame) {
  const MarchSpace march = space(false);
  SceneFrame frame;
  frame.centre = Vec3d(0, -10, 0);  // the region of interest lies behind the camera
  const std::vector<bool> cells = visibleCells(lookingAlongY(), frame, march);
  EXPECT_EQ(std::count(cells.begin(), cells.end(), true), 0);
}

TEST(VisibleCells, ExcludeSpaceNearerThanAnyObservation) {
  Capture capture = lookingAlongY();
  const RandomStream random(7, 1);
  for (uint32_t i = 0; i < 100; ++i) {
    capture.points.push_back({Vec3d(0, 0.5 + 0.4 * random.uniformDouble(i), 0), {}, 0});
    capture.observations.push_back({0, i, 50, 50, 0});
  }
  capture.points[3].xInWorld.y() = 0.1;  // an outlier
  const double nearest = nearestSparseDepth(capture)[0];
  EXPECT_GT(nearest, 0.49);
  EXPECT_LT(nearest, 0.55);
  const MarchSpace march = space(true);
  const std::vector<bool> cells = visibleCells(capture, SceneFrame(), march);
  EXPECT_FALSE(at(cells, march, inside(march, 0.05, 0.2, 0.05)));
  EXPECT_TRUE(at(cells, march, inside(march, 0.05, 0.6, 0.05)));
}

TEST(VisibleCells, ReachBehindAFisheyeThatSeesMoreThanHalfOfTheSphere) {
  Capture capture = lookingAlongY();
  capture.cameras[0].lens = LensModel::openCvFisheye;
  capture.cameras[0].parameters = {40, 40, 50, 50};  // sees up to 107 degrees off the axis, including the margin
  const MarchSpace march = space(true);
  const auto isSeen = [&](double x, double y, double z) {
    return at(visibleCells(capture, SceneFrame(), march), march, inside(march, x, y, z));
  };
  EXPECT_TRUE(isSeen(0.05, 0.8, 0.05));
  EXPECT_TRUE(isSeen(0.8, 0.05, 0.05));
  EXPECT_TRUE(isSeen(0.8, -0.1, 0.05));  // behind the image plane
  EXPECT_FALSE(
      at(visibleCells(capture, SceneFrame(), march), march, Vec3d(0.51, 0.01, 0.51)));  // directly behind the camera
  // Adds points on two rings around the axis, one in the image plane and one behind it.
  for (uint32_t i = 0; i < 100; ++i) {
    const double angle = 0.0628 * i;
    capture.points.push_back({Vec3d(std::cos(angle), i % 2 ? 0.0 : -0.3, std::sin(angle)), {}, 0});
    capture.observations.push_back({0, i, 50, 50, 0});
  }
  EXPECT_NEAR(nearestSparseDepth(capture)[0], 1, 0.05);
  EXPECT_FALSE(isSeen(0.4, -0.1, 0.05));
  EXPECT_TRUE(isSeen(0.95, -0.1, 0.05));
}

TEST(NearestSparseDepth, IsUnknownWithFewObservations) {
  Capture capture = lookingAlongY();
  capture.points.push_back({Vec3d(0, 1, 0), {}, 0});
  capture.observations.push_back({0, 0, 50, 50, 0});
  EXPECT_EQ(nearestSparseDepth(capture)[0], 0);
}

}  // namespace
}  // namespace tessera
