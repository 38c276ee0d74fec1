// Camera navigation: over a map, around a target, or flying; much as in the browser's viewer (web/src/app/moving).
// World units; Z is up.
#pragma once

#include <optional>

#include "scene/axes.h"

namespace tessera {

enum class NavigationMode { map, orbit, fly };

struct Look {
  Vec3d eye = Vec3d::UnitX(), target = Vec3d::Zero();
};

// The user's input since the last frame.
struct Moves {
  double seconds = 0;
  double viewHeight = 0.93;  // at distance 1, in world units: 2 tan(fov / 2)
  enum class Drag { none, left, right, middle } drag = Drag::none;
  double dragRight = 0, dragDown = 0;     // in window heights
  double wheel = 0;                       // notches, away from the user
  double right = 0, up = 0, forward = 0;  // from keys, -1 to 1
  bool fast = false;
};

class Navigation {
 public:
  // `low` and `high`: the box of what can be seen, in the world.
  Navigation(const Vec3d& low, const Vec3d& high);

  void setMode(NavigationMode mode);
  NavigationMode mode() const { return mode_; }

  const Look& look() const { return look_; }
  void setLook(const Look& look);  // immediately; flyTo animates
  void flyTo(const Look& look);
  Look overview(double aspect = 1.5) const;  // above and beside the middle, for a window of this width : height
  void focus(const Vec3d& place);            // moves the camera nearer to a place
  Look lookFromPose(const Pose& worldFromCamera) const;  // a target some way ahead of a photo's camera

  // Advances by one frame. Returns whether the camera has moved.
  bool update(const Moves& moves);
  Pose worldFromCamera() const;
  double radius() const;                   // of what can be seen, horizontally
  double speed() const { return speed_; }  // of flying, world units per second

 private:
  struct Flight {
    Look from, to;
    double seconds = 0;
  };
  void drag(const Moves& moves);
  void comeNearer(double notches);                   // by notches of a wheel
  void go(double right, double up, double forward);  // world units
  void turnAround(double yaw, double pitch);         // the target, in radians
  void turnHere(double yaw, double pitch);
  void flyOn(double seconds);
  double minDistance() const { return radius() / 400; }
  double maxDistance() const { return 6 * radius(); }

  Vec3d low_, high_;
  NavigationMode mode_ = NavigationMode::map;
  Look look_;
  std::optional<Flight> flight_;
  double speed_ = 1;
};

}  // namespace tessera
