// What photos show of the ground, as their tags tell before their poses are known: GPS, the gimbal, heights above
// take-off, and the focal length.
#pragma once

#include <optional>
#include <vector>

#include "photogrammetry/photo_list.h"
#include "scene/capture.h"

namespace tessera {

// What a photo shows of the ground, taken as a plane below the flight.
struct PhotoFootprint {
  int photo = 0;
  Vec3d eye = Vec3d::Zero();  // metres east, north and up; the ground is at 0
  Mat3d worldFromCamera = Mat3d::Identity();
  double slopeX = 0, slopeY = 0;  // half the picture over the focal length
  std::vector<Vec2d> places;      // of a grid of pixels
  Vec2d middle = Vec2d::Zero();
  double radius = 0;

  bool shows(const Vec2d& place) const;
};

// Whether each photo's GPS tells which others show the same: not if it is the place of a whole album, or of a receiver
// that has lost its satellites, unless the gimbal or the barometer tells more.
std::vector<bool> tellPlaces(const PhotoList& list);

// Whether each photo's tags tell what it shows of the ground: its place does, unless it looks above the horizon.
std::vector<bool> tellFootprints(const PhotoList& list);

// Returns the footprints of the photos whose GPS tells their places, in their order; of photos without gimbal angles as
// if they looked straight down. Heights above the ground that are not known are those of the other photos, or follow
// from the distances of the photos; those that are known count for at least what a survey with little overlap has.
std::vector<PhotoFootprint> photoFootprints(const PhotoList& list, const std::vector<bool>& tellPlace);

// Returns a capture of these photos, without files, in metres above the ground, with points on the ground where they
// look, to tell how large the place is: of several places, that of the largest group whose footprints overlap. Returns
// nothing if GPS tells the places of fewer than half of the photos, or there are fewer than three in that group.
std::optional<Capture> captureFromTags(const PhotoList& list);

}  // namespace tessera
