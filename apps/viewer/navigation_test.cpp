#include "apps/viewer/navigation.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tessera {
namespace {

const Vec3d kLow(-10, -10, 0), kHigh(10, 10, 4);

Moves dragged(Moves::Drag button, double right, double down) {
  Moves moves;
  moves.seconds = 0.016;
  moves.drag = button;
  moves.dragRight = right;
  moves.dragDown = down;
  return moves;
}

Moves heldKeys(double right, double up, double forward) {
  Moves moves;
  moves.seconds = 0.05;
  moves.right = right;
  moves.up = up;
  moves.forward = forward;
  return moves;
}

// Returns where a place is in the image: right and down, in focal lengths.
Vec2d inPicture(const Navigation& navigation, const Vec3d& place) {
  const Vec3d inCamera = navigation.worldFromCamera().inverse() * place;
  return {inCamera.x() / inCamera.z(), inCamera.y() / inCamera.z()};
}

TEST(Navigation, BeginsAboveAndBesideTheMiddle) {
  const Navigation navigation(kLow, kHigh);
  const double edge = std::tan(25.0 / 180 * M_PI);
  EXPECT_NEAR(inPicture(navigation, {0, 0, 0}).norm(), 0, 1e-12);
  for (const double x :
       {kLow.x(), kHigh.x()}) {  // in a window wider than high, distant places are in view, or nearly so
    const Vec2d at = inPicture(navigation, {x, kHigh.y(), kHigh.z()});
    EXPECT_LT(std::abs(at.y()), 1.1 * edge);
    EXPECT_LT(std::abs(at.x()), 1.3 * edge);
  }
  EXPECT_GT(navigation.look().eye.z(), kHigh.z());
}

TEST(Navigation, KeepsTheHorizonLevelAndCameraAxesRightHanded) {
  Navigation navigation(kLow, kHigh);
  navigation.setMode(NavigationMode::orbit);
  for (int i = 0; i < 40; ++i) {
    navigation.update(dragged(Moves::Drag::left, 0.07, i % 2 == 0 ? 0.2 : -0.1));
    const Mat3d axes = navigation.worldFromCamera().rotation;
    EXPECT_NEAR((axes.transpose() * axes - Mat3d::Identity()).norm(), 0, 1e-12);
    EXPECT_NEAR(axes.determinant(), 1, 1e-12);
    EXPECT_NEAR(axes(2, 0), 0, 1e-12);  // right is level
    EXPECT_LT(axes(2, 1), 0);           // the camera's down axis points downwards
  }
}

TEST(Navigation, DraggingOverTheMapTakesTheGroundAlong) {
  Navigation navigation(kLow, kHigh);
  const Vec3d place = navigation.look().target;
  const double height = navigation.look().eye.z();
  navigation.update(dragged(Moves::Drag::left, 0.1, 0.05));
  const Vec2d at = inPicture(navigation, place);
  // 0.1 of the window's height is 0.093 focal lengths at a field of view of 50 degrees.
  EXPECT_NEAR(at.x(), 0.093, 0.01);
  EXPECT_NEAR(at.y(), 0.0466, 0.01);
  EXPECT_EQ(navigation.look().eye.z(), height);
}

TEST(Navigation, TurnsAroundThePlaceThatItLooksAt) {
  Navigation navigation(kLow, kHigh);
  navigation.setMode(NavigationMode::orbit);
  const Look before = navigation.look();
  navigation.update(dragged(Moves::Drag::left, 0.25, 0));  // a quarter turn
  EXPECT_EQ(navigation.look().target, before.target);
  EXPECT_NEAR((navigation.look().eye - before.target).norm(), (before.eye - before.target).norm(), 1e-9);
  EXPECT_LT(navigation.look().eye.x(), -5);  // the image moves right, so the camera moves left
  navigation.update(dragged(Moves::Drag::left, 0, 2));
  EXPECT_GT(navigation.look().eye.z(),
            before.eye.z());  // the image moves down, so the camera moves up, but not beyond the map's limit
  EXPECT_LT(navigation.worldFromCamera().rotation(2, 2), -0.99);
}

TEST(Navigation, NeverLooksUpwardsOverTheMap) {
  Navigation navigation(kLow, kHigh);
  navigation.update(dragged(Moves::Drag::right, 0, -2));
  EXPECT_LT(navigation.worldFromCamera().rotation(2, 2), 0);
  EXPECT_GT(navigation.look().eye.z(), navigation.look().target.z());
}

TEST(Navigation, ApproachesTheTargetWithTheWheelWithoutPassingIt) {
  Navigation navigation(kLow, kHigh);
  const Look before = navigation.look();
  Moves moves;
  moves.wheel = 1;
  EXPECT_TRUE(navigation.update(moves));
  EXPECT_NEAR((navigation.look().eye - before.target).norm(), 0.85 * (before.eye - before.target).norm(), 1e-9);
  for (int i = 0; i < 1000; ++i) navigation.update(moves);
  EXPECT_NEAR((navigation.look().eye - before.target).norm(), navigation.radius() / 400, 1e-9);
  moves.wheel = -1;
  for (int i = 0; i < 1000; ++i) navigation.update(moves);
  EXPECT_NEAR((navigation.look().eye - before.target).norm(), 6 * navigation.radius(), 1e-9);
}

TEST(Navigation, MovesInTheViewingDirectionAndTurnsInPlaceInFlyMode) {
  Navigation navigation(kLow, kHigh);
  navigation.setMode(NavigationMode::fly);
  const Look before = navigation.look();
  navigation.update(heldKeys(0, 0, 1));
  const Vec3d way = navigation.look().eye - before.eye;
  EXPECT_NEAR(way.norm(), navigation.speed() * 0.05, 1e-9);
  EXPECT_NEAR(way.normalized().dot((before.target - before.eye).normalized()), 1, 1e-9);
  const Vec3d eye = navigation.look().eye;
  navigation.update(dragged(Moves::Drag::left, 0.1, 0.1));
  EXPECT_EQ(navigation.look().eye, eye);
  const Vec2d at = inPicture(navigation, before.target);
  EXPECT_GT(at.x(), 0.1);  // the image follows the pointer
  EXPECT_GT(at.y(), 0.1);
}

TEST(Navigation, KeysOverTheMapKeepTheHeight) {
  Navigation navigation(kLow, kHigh);
  const Vec3d eye = navigation.look().eye;
  navigation.update(heldKeys(1, 0, 1));
  EXPECT_EQ(navigation.look().eye.z(), eye.z());
  EXPECT_GT(navigation.look().eye.x(), eye.x());
  EXPECT_GT(navigation.look().eye.y(), eye.y());
}

TEST(Navigation, FliesToAViewInHalfASecondUnlessTheUserMoves) {
  Navigation navigation(kLow, kHigh);
  const Look there{{3, -4, 5}, {0, 0, 1}};
  Moves still;
  still.seconds = 0.2;
  navigation.flyTo(there);
  EXPECT_TRUE(navigation.update(still));
  EXPECT_NE(navigation.look().eye, there.eye);
  navigation.update(still);
  navigation.update(still);
  EXPECT_EQ(navigation.look().eye, there.eye);
  EXPECT_FALSE(navigation.update(still));
  navigation.flyTo(navigation.overview());
  navigation.update(heldKeys(0, 1, 0));
  const Vec3d eye = navigation.look().eye;
  EXPECT_FALSE(navigation.update(still));
  EXPECT_EQ(navigation.look().eye, eye);
}

TEST(Navigation, ViewsOfPhotosThatLookUpwardsLeaveTheMap) {
  Navigation navigation(kLow, kHigh);
  Pose photo;
  photo.rotation.col(2) = Vec3d(0, 0.8, 0.6);
  photo.rotation.col(0) = Vec3d(1, 0, 0);
  photo.rotation.col(1) = photo.rotation.col(2).cross(photo.rotation.col(0));
  photo.translation = {0, -8, 1};
  navigation.setLook(navigation.lookFromPose(photo));
  EXPECT_EQ(navigation.mode(), NavigationMode::orbit);
  EXPECT_NEAR((navigation.worldFromCamera().rotation - photo.rotation).norm(), 0, 1e-12);
  EXPECT_EQ(navigation.worldFromCamera().translation, photo.translation);
}

}  // namespace
}  // namespace tessera
