#include "apps/viewer/navigation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tessera {
namespace {

constexpr double kFlightSeconds = 0.5;
constexpr double kTurn = 2 * std::numbers::pi;          // radians, for a drag over the window's whole height
constexpr double kLookTurn = 1.5;                       // the same, when flying
constexpr double kMinFromUp = 0.02;                     // radians; never looks straight up or down
constexpr double kMapAngle = 0.495 * std::numbers::pi;  // largest angle from straight down on the map
constexpr double kWheel = 0.85;                         // factor of the distance to the target per notch
constexpr double kDragNotches = 20;                     // notches that a drag over the window's whole height stands for
const Vec3d kUp = Vec3d::UnitZ();

// A direction as its angle from straight up and its azimuth.
struct Angles {
  double fromUp = 0, around = 0;
};

Angles toAngles(const Vec3d& forward) {
  return {std::acos(std::clamp(forward.z(), -1.0, 1.0)), std::atan2(forward.y(), forward.x())};
}

Vec3d toDirection(const Angles& angles) {
  return {std::sin(angles.fromUp) * std::cos(angles.around), std::sin(angles.fromUp) * std::sin(angles.around),
          std::cos(angles.fromUp)};
}

Vec3d forwardDirection(const Look& look) {
  const Vec3d ahead = look.target - look.eye;
  const double length = ahead.norm();
  return length > 0 ? Vec3d(ahead / length) : Vec3d(-kUp);
}

// Returns the horizontal direction to the right of a viewing direction.
Vec3d rightDirection(const Vec3d& forward) {
  const Vec3d right = forward.cross(kUp);
  const double length = right.norm();
  return length > 1e-9 ? Vec3d(right / length) : Vec3d(Vec3d::UnitX());
}

}  // namespace

Navigation::Navigation(const Vec3d& low, const Vec3d& high) : low_(low), high_(high), speed_(radius() / 8) {
  look_ = overview();
}

double Navigation::radius() const {
  const Vec3d size = high_ - low_;
  return std::max(0.5 * std::hypot(size.x(), size.y()), 1e-6);
}

Look Navigation::overview(double aspect) const {
  Look look;
  look.target = 0.5 * (low_ + high_);
  look.target.z() = low_.z();
  look.eye = look.target + radius() * std::max(1.0, 1 / aspect) * Vec3d(0, -0.8, 0.75);
  return look;
}

void Navigation::setMode(NavigationMode mode) {
  if (mode_ == NavigationMode::fly && mode != NavigationMode::fly) {
    // Orbits around what was looked at, at the distance of the last target.
    const double distance = std::clamp((look_.target - look_.eye).norm(), minDistance(), radius());
    look_.target = look_.eye + distance * forwardDirection(look_);
  }
  mode_ = mode;
  flight_.reset();
  if (mode == NavigationMode::map && toAngles(forwardDirection(look_)).fromUp < std::numbers::pi - kMapAngle) {
    turnAround(0, 0);  // the map never looks upwards
  }
}

void Navigation::setLook(const Look& look) {
  flight_.reset();
  look_ = look;
  if (mode_ == NavigationMode::map && toAngles(forwardDirection(look)).fromUp < std::numbers::pi - kMapAngle) {
    mode_ = NavigationMode::orbit;
  }
}

void Navigation::flyTo(const Look& look) {
  if (mode_ == NavigationMode::map && toAngles(forwardDirection(look)).fromUp < std::numbers::pi - kMapAngle) {
    mode_ = NavigationMode::orbit;
  }
  flight_ = {look_, look, 0};
}

void Navigation::focus(const Vec3d& place) {
  Vec3d away = 0.4 * (look_.eye - place);
  if (away.norm() < 2 * minDistance()) away = 2 * minDistance() * away.normalized();
  flyTo({place + away, place});
}

Look Navigation::lookFromPose(const Pose& worldFromCamera) const {
  const Vec3d eye = worldFromCamera.translation, forward = worldFromCamera.rotation.col(2);
  // Chooses the distance to the ground if the camera looks down on it, otherwise to the middle of the scene.
  double distance = (0.5 * (low_ + high_) - eye).dot(forward);
  if (forward.z() < -0.2) distance = (eye.z() - low_.z()) / -forward.z();
  distance = std::clamp(distance, 0.1 * radius(), 2 * radius());
  return {eye, eye + distance * forward};
}

Pose Navigation::worldFromCamera() const {
  const Vec3d forward = forwardDirection(look_), right = rightDirection(forward);
  Pose pose;
  pose.rotation.col(0) = right;
  pose.rotation.col(1) = forward.cross(right);
  pose.rotation.col(2) = forward;
  pose.translation = look_.eye;
  return pose;
}

bool Navigation::update(const Moves& moves) {
  const Look before = look_;
  const bool byHand =
      moves.drag != Moves::Drag::none || moves.wheel != 0 || moves.right != 0 || moves.up != 0 || moves.forward != 0;
  if (byHand) flight_.reset();
  flyOn(moves.seconds);
  drag(moves);
  if (moves.wheel != 0) {
    if (mode_ == NavigationMode::fly) {
      speed_ = std::clamp(speed_ * std::pow(1.2, moves.wheel), radius() / 1000, 10 * radius());
    } else {
      comeNearer(moves.wheel);
    }
  }
  const double pace = mode_ == NavigationMode::fly ? speed_ : 0.8 * (look_.eye - look_.target).norm();
  const double way = pace * (moves.fast ? 4 : 1) * std::min(moves.seconds, 0.1);
  go(moves.right * way, moves.up * way, moves.forward * way);
  return look_.eye != before.eye || look_.target != before.target;
}

void Navigation::comeNearer(double notches) {
  const double now = (look_.eye - look_.target).norm();
  const double distance = std::clamp(now * std::pow(kWheel, notches), minDistance(), maxDistance());
  look_.eye = look_.target - distance * forwardDirection(look_);
}

void Navigation::drag(const Moves& moves) {
  if (moves.drag == Moves::Drag::none || (moves.dragRight == 0 && moves.dragDown == 0)) return;
  if (mode_ == NavigationMode::fly) {
    turnHere(moves.dragRight * kLookTurn, moves.dragDown * kLookTurn);  // drags the image
    return;
  }
  if (moves.drag == Moves::Drag::middle) {
    comeNearer(-moves.dragDown * kDragNotches);
    return;
  }
  const bool turns = (moves.drag == Moves::Drag::left) == (mode_ == NavigationMode::orbit);
  if (turns) {
    turnAround(-moves.dragRight * kTurn, -moves.dragDown * kTurn);
    return;
  }
  const Vec3d forward = forwardDirection(look_), right = rightDirection(forward);
  const double height =
      moves.viewHeight * (look_.eye - look_.target).norm();  // of the window at the target, in world units
  // Moves over the ground, or in the image plane.
  Vec3d down = forward.cross(right);
  double share = 1;
  if (mode_ == NavigationMode::map) {
    down = -kUp.cross(right);
    share = 1 / std::max(0.2, std::abs(forward.z()));
  }
  const Vec3d way = -height * (moves.dragRight * right + share * moves.dragDown * down);
  look_.eye += way;
  look_.target += way;
}

void Navigation::go(double right, double up, double forward) {
  if (right == 0 && up == 0 && forward == 0) return;
  Vec3d ahead = forwardDirection(look_);
  const Vec3d side = rightDirection(ahead);
  if (mode_ != NavigationMode::fly) ahead = kUp.cross(side);  // over the ground
  const Vec3d way = right * side + up * kUp + forward * ahead;
  look_.eye += way;
  look_.target += way;
}

void Navigation::turnAround(double yaw, double pitch) {
  Angles angles = toAngles(forwardDirection(look_));
  angles.around += yaw;
  const double minimum = mode_ == NavigationMode::map ? std::numbers::pi - kMapAngle : kMinFromUp;
  angles.fromUp = std::clamp(angles.fromUp - pitch, minimum, std::numbers::pi - kMinFromUp);
  look_.eye = look_.target - (look_.target - look_.eye).norm() * toDirection(angles);
}

void Navigation::turnHere(double yaw, double pitch) {
  Angles angles = toAngles(forwardDirection(look_));
  angles.around += yaw;
  angles.fromUp = std::clamp(angles.fromUp - pitch, kMinFromUp, std::numbers::pi - kMinFromUp);
  look_.target = look_.eye + (look_.target - look_.eye).norm() * toDirection(angles);
}

void Navigation::flyOn(double seconds) {
  if (!flight_) return;
  flight_->seconds += seconds;
  const double passed = std::min(flight_->seconds / kFlightSeconds, 1.0);
  const double smooth = passed * passed * (3 - 2 * passed);
  look_.eye = flight_->from.eye + smooth * (flight_->to.eye - flight_->from.eye);
  look_.target = flight_->from.target + smooth * (flight_->to.target - flight_->from.target);
  if (passed == 1) flight_.reset();
}

}  // namespace tessera
