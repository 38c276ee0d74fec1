#include "photogrammetry/photo_pairs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <set>

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
// Footprints end where rays are so near the horizon that they go farther than this many heights.
constexpr double kFarthestHeights = 6;

// What a photo shows of the ground, taken as a plane below the flight.
struct Footprint {
  int photo = 0;
  Vec3d eye = Vec3d::Zero();  // metres east, north and up; the ground is at 0
  Mat3d worldFromCamera = Mat3d::Identity();
  double slopeX = 0, slopeY = 0;  // half the picture over the focal length
  std::vector<Vec2d> places;      // of a grid of pixels
  Vec2d middle = Vec2d::Zero();
  double radius = 0;

  bool shows(const Vec2d& place) const {
    const Vec3d inCamera = worldFromCamera.transpose() * (Vec3d(place.x(), place.y(), 0) - eye);
    return inCamera.z() > 0 && std::abs(inCamera.x()) <= slopeX * inCamera.z() &&
           std::abs(inCamera.y()) <= slopeY * inCamera.z();
  }
};

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

Footprint makeFootprint(const PhotoList& list, int photo, const Vec3d& eye) {
  const ListedPhoto& p = list.photos[static_cast<size_t>(photo)];
  const CameraBody& body = list.bodies[static_cast<size_t>(p.body)];
  Footprint print;
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

// Whether each photo's GPS tells which others show the same: not if it is the place of a whole album, or of a receiver
// that has lost its satellites, unless the gimbal or the barometer tells more.
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

// Of the photos whose GPS tells their places.
std::vector<Footprint> footprints(const PhotoList& list, const std::vector<bool>& tellPlace) {
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
  std::vector<Footprint> prints;
  for (size_t k = 0; k < photos.size(); ++k) {
    const double stated = fixes[k].relativeAltitude > kLeastHeight ? fixes[k].relativeAltitude : unknown;
    prints.push_back(makeFootprint(list, photos[k], Vec3d(places[k].x(), places[k].y(), std::max(stated, least))));
  }
  return prints;
}

double sharedShare(const Footprint& a, const Footprint& b) {
  if ((a.middle - b.middle).norm() > a.radius + b.radius) return 0;
  const auto shared = [](const Footprint& of, const Footprint& in) {
    const auto n = std::count_if(of.places.begin(), of.places.end(), [&](const Vec2d& x) { return in.shows(x); });
    return of.places.empty() ? 0 : static_cast<double>(n) / static_cast<double>(of.places.size());
  };
  // The mean: a photo from high above holds all of a lower one's footprint, which fills little of it.
  return 0.5 * (shared(a, b) + shared(b, a));
}

PhotoPair inOrder(int a, int b) {
  return {std::min(a, b), std::max(a, b)};
}

void pairInSequence(const PhotoList& list, const std::vector<bool>& tellPlace, const PairOptions& options,
                    std::set<PhotoPair>& pairs) {
  std::map<int, std::vector<int>> flights;
  for (size_t i = 0; i < list.photos.size(); ++i) flights[list.photos[i].flight].push_back(static_cast<int>(i));
  for (auto& [flight, photos] : flights) {
    std::stable_sort(photos.begin(), photos.end(), [&](int a, int b) {
      return list.photos[static_cast<size_t>(a)].tags.takenAt.value_or(0) <
             list.photos[static_cast<size_t>(b)].tags.takenAt.value_or(0);
    });
    for (size_t i = 0; i < photos.size(); ++i) {
      for (size_t k = i + 1; k < photos.size(); ++k) {
        const bool tell = tellPlace[static_cast<size_t>(photos[i])] && tellPlace[static_cast<size_t>(photos[k])];
        const auto distance = static_cast<int>(k - i);
        if (distance > std::max(options.neighbours, options.sequence)) break;
        if (distance <= (tell ? options.neighbours : options.sequence)) pairs.insert(inOrder(photos[i], photos[k]));
      }
    }
  }
}

struct Candidate {
  double overlap;
  int a, b;  // indices into the footprints
};

void pairByFootprint(const PhotoList& list, const std::vector<bool>& tellPlace, const PairOptions& options,
                     std::set<PhotoPair>& pairs) {
  const std::vector<Footprint> prints = footprints(list, tellPlace);
  std::vector<std::vector<Candidate>> candidates(prints.size());
  std::vector<Candidate> all;
  for (size_t a = 0; a < prints.size(); ++a) {
    for (size_t b = a + 1; b < prints.size(); ++b) {
      const double overlap = sharedShare(prints[a], prints[b]);
      if (overlap <= 0) continue;
      const Candidate candidate{overlap, static_cast<int>(a), static_cast<int>(b)};
      all.push_back(candidate);
      const double cosine = prints[a].worldFromCamera.col(2).dot(prints[b].worldFromCamera.col(2));
      if (overlap < options.minOverlap || cosine < std::cos(options.maxAngle * kDegree)) continue;
      candidates[a].push_back(candidate);
      candidates[b].push_back(candidate);
    }
  }
  const auto byOverlap = [](const Candidate& x, const Candidate& y) {
    return std::tuple(-x.overlap, x.b - x.a, x.a) < std::tuple(-y.overlap, y.b - y.a, y.a);
  };
  const auto photo = [&](int print) { return prints[static_cast<size_t>(print)].photo; };
  for (size_t i = 0; i < prints.size(); ++i) {
    std::sort(candidates[i].begin(), candidates[i].end(), byOverlap);
    std::map<int, int> taken;  // by flight
    int count = 0;
    const int own = list.photos[static_cast<size_t>(prints[i].photo)].flight;
    for (const Candidate& candidate : candidates[i]) {
      const int other = candidate.a == static_cast<int>(i) ? candidate.b : candidate.a;
      const int flight = list.photos[static_cast<size_t>(photo(other))].flight;
      const bool isBest = count++ < options.partners;
      if (!isBest && (flight == own || taken[flight] >= options.otherFlight)) continue;
      ++taken[flight];
      pairs.insert(inOrder(prints[i].photo, photo(other)));
    }
  }
  // A spanning tree by overlap, whatever the angles, so that no photo stands alone.
  std::sort(all.begin(), all.end(), byOverlap);
  std::vector<int> root(prints.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&root](int i) {
    while (root[static_cast<size_t>(i)] != i)
      i = root[static_cast<size_t>(i)] = root[static_cast<size_t>(root[static_cast<size_t>(i)])];
    return i;
  };
  for (const Candidate& candidate : all) {
    const int a = find(candidate.a), b = find(candidate.b);
    if (a == b) continue;
    root[static_cast<size_t>(a)] = b;
    pairs.insert(inOrder(photo(candidate.a), photo(candidate.b)));
  }
}

void pairLookAlikes(const std::vector<bool>& tellPlace, const LookAlikes& lookAlikes, int partners,
                    std::set<PhotoPair>& pairs) {
  for (size_t i = 0; i < lookAlikes.size(); ++i) {
    int count = 0;
    for (const int other : lookAlikes[i]) {
      const auto o = static_cast<size_t>(other);
      if (count == partners) break;
      // Their places tell more, if they are known of both.
      if (other == static_cast<int>(i) || (tellPlace[i] && tellPlace[o])) continue;
      ++count;
      pairs.insert(inOrder(static_cast<int>(i), other));
    }
  }
}

}  // namespace

bool needsLookAlikes(const PhotoList& list, const PairOptions& options) {
  if (static_cast<int>(list.photos.size()) <= options.all) return false;
  const std::vector<bool> tellPlace = tellPlaces(list);
  return std::find(tellPlace.begin(), tellPlace.end(), false) != tellPlace.end();
}

std::vector<PhotoPair> choosePairs(const PhotoList& list, const LookAlikes& lookAlikes, const PairOptions& options) {
  std::set<PhotoPair> pairs;
  const int count = static_cast<int>(list.photos.size());
  if (count <= options.all) {
    for (int a = 0; a < count; ++a)
      for (int b = a + 1; b < count; ++b) pairs.emplace(a, b);
    return {pairs.begin(), pairs.end()};
  }
  const std::vector<bool> tellPlace = tellPlaces(list);
  pairInSequence(list, tellPlace, options, pairs);
  pairByFootprint(list, tellPlace, options, pairs);
  pairLookAlikes(tellPlace, lookAlikes, options.lookAlikes, pairs);
  return {pairs.begin(), pairs.end()};
}

std::vector<PhotoPair> chooseMorePairs(const PhotoList& list, const LookAlikes& lookAlikes,
                                       const std::vector<int>& photos) {
  const PairOptions wide{.all = 0,
                         .partners = 40,
                         .otherFlight = 20,
                         .neighbours = 10,
                         .sequence = 40,
                         .lookAlikes = kMaxLookAlikes,
                         .minOverlap = 0.02,
                         .maxAngle = 90};
  std::vector<PhotoPair> pairs = choosePairs(list, lookAlikes, wide);
  std::erase_if(pairs, [&](const PhotoPair& pair) {
    return std::find(photos.begin(), photos.end(), pair.first) == photos.end() &&
           std::find(photos.begin(), photos.end(), pair.second) == photos.end();
  });
  return pairs;
}

}  // namespace tessera
