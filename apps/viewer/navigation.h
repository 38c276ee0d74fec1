// How people move: over a map, around a place, or flying; much as in the browser's viewer (web/src/app/moving). World
// units; Z is up.
#pragma once

#include <optional>

#include "scene/axes.h"

namespace tessera {

enum class NavigationMode { map, orbit, fly };

struct Look {
  Vec3d eye = Vec3d::UnitX(), target = Vec3d::Zero();
};

// What people did since the last picture.
struct Moves {
  double seconds = 0;
  double viewHeight = 0.93;  // of the window at distance 1: 2 tan(fov / 2)
  enum class Drag { none, left, right, middle } drag = Drag::none;
  double dragRight = 0, dragDown = 0;     // of the window's height
  double wheel = 0;                       // notches, away from oneself
  double right = 0, up = 0, forward = 0;  // of keys, -1 to 1
  bool fast = false;
};

class Navigation {
 public:
  // A box around what there is to be seen, in the world.
  Navigation(const Vec3d& low, const Vec3d& high);

  void setMode(NavigationMode mode);
  NavigationMode mode() const { return mode_; }

  const Look& look() const { return look_; }
  void setLook(const Look& look);  // at once; flyTo takes its time
  void flyTo(const Look& look);
  Look overview(double aspect = 1.5) const;        // above and beside the middle; of a window so much wider than high
  void focus(const Vec3d& place);                  // comes nearer to a place, from where the camera is
  Look lookOf(const Pose& worldFromCamera) const;  // what a photo looks at, some way ahead

  // Once a picture. True where the camera has moved.
  bool update(const Moves& moves);
  Pose worldFromCamera() const;
  double radius() const;                   // of what there is to be seen, over the ground
  double speed() const { return speed_; }  // when flying, world units a second

 private:
  struct Flight {
    Look from, to;
    double seconds = 0;
  };
  void drag(const Moves& moves);
  void comeNearer(double notches);                   // of a wheel
  void go(double right, double up, double forward);  // world units
  void turnAround(double yaw, double pitch);         // the target; radians
  void turnHere(double yaw, double pitch);
  void flyOn(double seconds);
  double leastDistance() const { return radius() / 400; }
  double mostDistance() const { return 6 * radius(); }

  Vec3d low_, high_;
  NavigationMode mode_ = NavigationMode::map;
  Look look_;
  std::optional<Flight> flight_;
  double speed_ = 1;
};

}  // namespace tessera
