// The ground of a capture: a plane, and coordinates that stand on it.
// Source: Fischler and Bolles, "Random sample consensus", 1981, for the fit; City-on-Web, section 4.1, for its use.
#pragma once

#include <string>

#include "scene/capture.h"

namespace tessera {

// Ground coordinates: x and y along the ground (x as near the world's x as it can be), z the height above it. World
// units.
struct Ground {
  Mat3d groundFromWorld = Mat3d::Identity();  // a rotation
  double height = 0;                          // of the ground along up, from the world's origin
  std::string how;                            // for people: what it was found from

  Vec3d up() const { return groundFromWorld.row(2); }
  Vec3d inGround(const Vec3d& xInWorld) const { return groundFromWorld * xInWorld - Vec3d(0, 0, height); }
  Vec3d inWorld(const Vec3d& xInGround) const {
    return groundFromWorld.transpose() * (xInGround + Vec3d(0, 0, height));
  }
};

// Up is that of the geo reference where there is one; else the normal of a plane fitted to the sparse points, unless
// fewer than kEnoughGroundPoints of them are there, fewer than a tenth agree on one, or it is tilted by more than
// kMostTilt against the world's z (import has turned that up roughly); else the world's z. The height is that of the
// lowest layer that is full of points (roofs are layers too). Without enough points, the drones' heights above
// take-off say it; without those, the point nearest to all optical axes; and where the cameras look straight down in
// parallel, which says nothing, half the width of the flight below them is as good a guess as any.
inline constexpr size_t kEnoughGroundPoints = 50;
inline constexpr double kMostTilt = 30;  // degrees
Ground findGround(const Capture& capture);

}  // namespace tessera
