// The region of interest: the part of the ground that a capture shows well.
#pragma once

#include <string>
#include <vector>

#include "partition/ground.h"
#include "partition/rectangle.h"

namespace tessera {

struct Region {
  Rectangle rectangle;      // on the ground: ground x and y
  double groundPixel = 0;   // median over photos of a pixel's width on the ground, world units
  std::vector<Vec2d> hull;  // of the covered ground, ground x and y, counterclockwise; empty unless looksAtGround
  bool looksAtGround = true;
  std::string how;  // for log messages: what it was derived from
};

// Returns the smallest rectangle (see smallestRectangle) around all parts of the ground that kEnoughPhotos training
// photos show (or the highest number of photos that any part has, if lower). A pixel shows the ground where its ray
// meets it at kMinSlope or more: what oblique photos show at lower slopes is far away and coarse, and needs no blocks.
// Where most photos show nothing at that slope, half of it suffices. Where fewer than half of the cameras look down by
// kMinAxisSlope, they do not look at the ground but stand inside the scene, and the region is a square around the
// sparse points (2nd to 98th percentile), or, with fewer than kEnoughRegionPoints points, around the cameras and the
// point that they look at. Uses the photos of photosTogether, of which there must be at least one.
inline constexpr int kEnoughPhotos = 3;
inline constexpr double kMinSlope = 30, kMinAxisSlope = 15;  // degrees between ray and ground
inline constexpr size_t kEnoughRegionPoints = 200;
Region findRegion(const Capture& capture, const Ground& ground);

}  // namespace tessera
