// The region of interest: what a capture shows well of the ground.
#pragma once

#include <string>
#include <vector>

#include "partition/ground.h"
#include "partition/rectangle.h"

namespace tessera {

struct Region {
  Rectangle rectangle;      // on the ground: ground x and y
  double groundPixel = 0;   // median over photos of a pixel's width there, world units
  std::vector<Vec2d> hull;  // of what is covered, ground x and y, counterclockwise; empty when not looksAtGround
  bool looksAtGround = true;
  std::string how;  // for people: what it was found from
};

// The smallest rectangle, turned where that is worth it, about every place on the ground that kEnoughPhotos training
// photos show (or as many as any place has). A pixel shows the ground where its ray meets it at kLeastSlope or more:
// what oblique photos show beyond that is far away, coarse, and no reason to make blocks of it. Where most photos show
// nothing so steeply, half of that will do. Cameras of which fewer than half look down by kLeastAxisSlope do not look
// at the ground, they stand among things, and the region is one square: about the sparse points (2nd to 98th
// percentile), with fewer than kEnoughRegionPoints about the cameras and what they look at. Photos as photosTogether
// gives them, not none.
inline constexpr int kEnoughPhotos = 3;
inline constexpr double kLeastSlope = 30, kLeastAxisSlope = 15;  // degrees between ray and ground
inline constexpr size_t kEnoughRegionPoints = 200;
Region findRegion(const Capture& capture, const Ground& ground);

}  // namespace tessera
