#include "photogrammetry/photo_footprints.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>

#include "base/order_statistics.h"
#include "import/georeference.h"

namespace tessera {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr int kSamples = 7;                                                     // of a footprint, along each side
constexpr double kUnknownFocal = 0.8;                                           // of the longer side, as in most drones
constexpr double kLeastHeight = 5, kUnknownHeight = 80, kGreatestHeight = 500;  // metres
// Of the distance of neighbouring photos, the side of the footprint of a survey with an overlap of 80 %, and with the
// least that surveys have, 60 %.
constexpr double kSideOfDistance = 5, kLeastSideOfDistance = 2.5;
// Photos at exactly one place beyond which their receiver has not moved with them.
constexpr int kMaxAtOnePlace = 4;
constexpr size_t kLeastPhotos = 3;  // whose tags tell of a place
// Footprints end where rays are so near the horizon that they go farther than this many heights.
constexpr double kFarthestHeights = 6;

// Gimbal angles: yaw clockwise from north, pitch above the horizon, roll about the optical axis.
Mat3d rotationFromGimbal(const GimbalAngles& gimbal) {
  const double yaw = gimbal.yaw * kDegree, pitch = gimbal.pitch * kDegree;
  const Vec3d level(std::sin(yaw), std::cos(yaw), 0);
  const Vec3d forward = std::cos(pitch) * level + std::sin(pitch) * Vec3d::UnitZ();
  const Vec3d right(level.y(), -level.x(), 0);
  Mat3d rotation;
  rotation << right, forward.cross(right), forward;
  return rotation * Eigen::AngleAxisd(gimbal.roll * kDegree, Vec3d::UnitZ()).toRotationMatrix();
}

double focalLength(const CameraBody& body) {
  return body.focalLength > 0 ? body.focalLength : kUnknownFocal * std::max(body.width, body.height);
}

PhotoFootprint makeFootprint(const PhotoList& list, int photo, const Vec3d& eye) {
  const ListedPhoto& p = list.photos[static_cast<size_t>(photo)];
  const CameraBody& body = list.bodies[static_cast<size_t>(p.body)];
  PhotoFootprint print;
  print.photo = photo;
  print.eye = eye;
  print.worldFromCamera = rotationFromGimbal(p.tags.gimbal.value_or(GimbalAngles{0, -90, 0}));
  const double focal = focalLength(body);
  print.slopeX = 0.5 * body.width / focal;
  print.slopeY = 0.5 * body.height / focal;
  // Nothing says how a photo without gimbal angles is turned about the vertical: its footprint is a square.
  if (!p.tags.gimbal) print.slopeX = print.slopeY = std::sqrt(print.slopeX * print.slopeY);
  for (int j = 0; j < kSamples; ++j) {
    for (int i = 0; i < kSamples; ++i) {
      const double x = (2 * i + 1.0) / kSamples - 1, y = (2 * j + 1.0) / kSamples - 1;
      const Vec3d ray = print.worldFromCamera * Vec3d(x * print.slopeX, y * print.slopeY, 1);
      if (!(ray.z() < 0)) continue;
      const double distance = -eye.z() / ray.z();
      if (distance * ray.head<2>().norm() > kFarthestHeights * eye.z()) continue;
      print.places.emplace_back(eye.head<2>() + distance * ray.head<2>());
    }
  }
  for (const Vec2d& place : print.places) print.middle += place / static_cast<double>(print.places.size());
  for (const Vec2d& place : print.places) print.radius = std::max(print.radius, (place - print.middle).norm());
  return print;
}

// Returns the height above the ground at which a footprint's shorter side is so many times the distance of neighbouring
// photos; nothing if they all stand at one place.
std::optional<double> heightFromDistances(const PhotoList& list, const std::vector<int>& photos,
                                          const std::vector<Vec2d>& places, double sideOfDistance) {
  std::vector<double> distances, slopes;
  for (const int photo : photos) {
    const CameraBody& body = list.bodies[static_cast<size_t>(list.photos[static_cast<size_t>(photo)].body)];
    slopes.push_back(std::min(body.width, body.height) / focalLength(body));
  }
  for (const Vec2d& place : places) {
    double nearest = std::numeric_limits<double>::infinity();
    for (const Vec2d& other : places) {
      const double distance = (place - other).norm();
      if (distance > 1) nearest = std::min(nearest, distance);  // photos of one stop say nothing
    }
    if (std::isfinite(nearest)) distances.push_back(nearest);
  }
  if (distances.empty()) return std::nullopt;
  return std::clamp(sideOfDistance * upperMedian(distances) / upperMedian(slopes), kLeastHeight, kGreatestHeight);
}

}  // namespace

bool PhotoFootprint::shows(const Vec2d& place) const {
  const Vec3d inCamera = worldFromCamera.transpose() * (Vec3d(place.x(), place.y(), 0) - eye);
  return inCamera.z() > 0 && std::abs(inCamera.x()) <= slopeX * inCamera.z() &&
         std::abs(inCamera.y()) <= slopeY * inCamera.z();
}

std::vector<bool> tellPlaces(const PhotoList& list) {
  std::map<std::pair<double, double>, int> counts;
  for (const ListedPhoto& photo : list.photos)
    if (photo.tags.gps) ++counts[{photo.tags.gps->latitude, photo.tags.gps->longitude}];
  std::vector<bool> tell;
  for (const ListedPhoto& photo : list.photos) {
    const auto& gps = photo.tags.gps;
    tell.push_back(gps && (photo.tags.gimbal || gps->relativeAltitude != 0 ||
                           counts[{gps->latitude, gps->longitude}] <= kMaxAtOnePlace));
  }
  return tell;
}

std::vector<PhotoFootprint> photoFootprints(const PhotoList& list, const std::vector<bool>& tellPlace) {
  std::vector<GpsFix> fixes;
  std::vector<int> photos;
  std::vector<double> heights;  // those above take-off that are stated
  for (size_t i = 0; i < list.photos.size(); ++i) {
    if (!tellPlace[i]) continue;
    photos.push_back(static_cast<int>(i));
    fixes.push_back(*list.photos[i].tags.gps);
    if (fixes.back().relativeAltitude > kLeastHeight) heights.push_back(fixes.back().relativeAltitude);
  }
  const GeoFrame frame = frameAround(fixes);
  std::vector<Vec2d> places;
  for (const GpsFix& gps : fixes) places.push_back(enuFromGps(frame, gps.latitude, gps.longitude, 0).head<2>());
  // A drone that took off from a hill says that it is lower than it is above the ground, and neighbouring lines would
  // not seem to overlap.
  const double least = heightFromDistances(list, photos, places, kLeastSideOfDistance).value_or(kLeastHeight);
  const double unknown = heights.empty()
                             ? heightFromDistances(list, photos, places, kSideOfDistance).value_or(kUnknownHeight)
                             : upperMedian(heights);
  std::vector<PhotoFootprint> prints;
  for (size_t k = 0; k < photos.size(); ++k) {
    const double stated = fixes[k].relativeAltitude > kLeastHeight ? fixes[k].relativeAltitude : unknown;
    prints.push_back(makeFootprint(list, photos[k], Vec3d(places[k].x(), places[k].y(), std::max(stated, least))));
  }
  return prints;
}

std::vector<bool> tellFootprints(const PhotoList& list) {
  std::vector<bool> tell = tellPlaces(list);
  for (const PhotoFootprint& print : photoFootprints(list, tell))
    if (print.places.empty()) tell[static_cast<size_t>(print.photo)] = false;
  return tell;
}

namespace {

// Returns the largest group of footprints that overlap with one another, directly or by way of others.
std::vector<PhotoFootprint> largestGroup(const std::vector<PhotoFootprint>& prints) {
  std::vector<size_t> ungrouped(prints.size()), largest;
  std::iota(ungrouped.begin(), ungrouped.end(), size_t{0});
  while (ungrouped.size() > largest.size()) {
    std::vector<size_t> group{ungrouped.back()};
    ungrouped.pop_back();
    for (size_t next = 0; next < group.size(); ++next) {
      const PhotoFootprint& from = prints[group[next]];
      const auto overlaps = std::partition(ungrouped.begin(), ungrouped.end(), [&](size_t other) {
        return (prints[other].middle - from.middle).norm() > prints[other].radius + from.radius;
      });
      group.insert(group.end(), overlaps, ungrouped.end());
      ungrouped.erase(overlaps, ungrouped.end());
    }
    if (group.size() > largest.size()) largest = std::move(group);
  }
  std::sort(largest.begin(), largest.end());
  std::vector<PhotoFootprint> chosen;
  for (const size_t i : largest) chosen.push_back(prints[i]);
  return chosen;
}

}  // namespace

std::optional<Capture> captureFromTags(const PhotoList& list) {
  const std::vector<bool> tellPlace = tellPlaces(list);
  const auto known = static_cast<size_t>(std::count(tellPlace.begin(), tellPlace.end(), true));
  if (known < kLeastPhotos || 2 * known < list.photos.size()) return std::nullopt;
  Capture capture;
  for (const CameraBody& body : list.bodies) {
    const double focal = focalLength(body);
    capture.cameras.push_back(
        {body.width, body.height, LensModel::pinhole, {focal, focal, body.width / 2.0, body.height / 2.0}});
  }
  std::vector<GpsFix> fixes;
  for (const PhotoFootprint& print : largestGroup(photoFootprints(list, tellPlace))) {
    const ListedPhoto& listed = list.photos[static_cast<size_t>(print.photo)];
    Photo photo;
    photo.name = listed.name;
    photo.camera = listed.body;
    photo.worldFromCamera = {print.worldFromCamera, print.eye};
    photo.gps = listed.tags.gps;
    photo.gps->relativeAltitude = print.eye.z();
    fixes.push_back(*photo.gps);
    for (const Vec2d& place : print.places) capture.points.push_back({Vec3d(place.x(), place.y(), 0), {}, 0});
    capture.photos.push_back(std::move(photo));
  }
  if (fixes.size() < kLeastPhotos) return std::nullopt;
  capture.geo = frameAround(fixes);
  return capture;
}

}  // namespace tessera
