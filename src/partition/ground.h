// The ground of a capture: a plane, and coordinates relative to it.
// Source: Fischler and Bolles, "Random sample consensus", 1981, for the fit; City-on-Web, section 4.1, for its use.
#pragma once

#include <string>

#include "scene/capture.h"

namespace tessera {

// Ground coordinates: x and y along the ground (x as close to the world's x as possible), z the height above it, in
// world units.
struct Ground {
  Mat3d groundFromWorld = Mat3d::Identity();  // a rotation
  double height = 0;                          // of the ground along up, from the world's origin
  std::string how;                            // for log messages: what it was derived from

  Vec3d up() const { return groundFromWorld.row(2); }
  Vec3d inGround(const Vec3d& xInWorld) const { return groundFromWorld * xInWorld - Vec3d(0, 0, height); }
  Vec3d inWorld(const Vec3d& xInGround) const {
    return groundFromWorld.transpose() * (xInGround + Vec3d(0, 0, height));
  }
};

// Finds the ground. Up is that of the geo reference if there is one; else the normal of a plane fitted to the sparse
// points, unless there are fewer than kEnoughGroundPoints of them, fewer than a tenth lie on one plane, or it is tilted
// by more than kMaxTilt from the world's z (which import has roughly turned up); else the world's z. The height is that
// of the lowest layer that is dense with points (roofs form layers too). Without enough points it is derived from the
// drones' heights above take-off; without those, from the point nearest to all optical axes; and where the cameras look
// straight down in parallel, which determines no such point, it is assumed to be half the width of the flight below
// them.
inline constexpr size_t kEnoughGroundPoints = 50;
inline constexpr double kMaxTilt = 30;  // degrees
Ground findGround(const Capture& capture);

}  // namespace tessera
