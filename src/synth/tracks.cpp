#include "synth/tracks.h"

#include <algorithm>
#include <numbers>

#include "base/random.h"
#include "synth/surface.h"

namespace tessera {
namespace {

struct Track {
  SparsePoint point;
  std::vector<Observation> observations;  // `point` is not set yet
};

double gaussian(const RandomStream& random, uint64_t index) {
  const double u = 1 - random.uniformDouble(2 * index), v = random.uniformDouble(2 * index + 1);
  return std::sqrt(-2 * std::log(u)) * std::cos(2 * std::numbers::pi * v);
}

bool visible(const CityScene& city, const Vec3d& eye, const Vec3d& x) {
  const Vec3d way = x - eye;
  const float distance = static_cast<float>(way.norm());
  const float slack = 0.02f + 1e-4f * distance;
  return !city.tracer->occluded({eye.cast<float>(), (way / way.norm()).cast<float>(), 0.05f, distance - slack});
}

// Returns nothing if the ray meets sky, a mirror, foliage or a place that too few photos see.
std::optional<Track> follow(const CityScene& city, const LensTable& lens, const Capture& capture,
                            const TrackOptions& options, uint64_t index) {
  const RandomStream random(mix64(options.seed) ^ 0x7261636bull, index);
  const Camera& camera = lens.camera();
  const Photo& source = capture.photos[random.below(0, static_cast<uint32_t>(capture.photos.size()))];
  const Eigen::Vector2d slope =
      lens.slopeAt(camera.width * random.uniformDouble(1), camera.height * random.uniformDouble(2));
  const Vec3d direction = source.worldFromCamera.rotation * Vec3d(slope.x(), slope.y(), 1).normalized();
  const Ray ray{source.worldFromCamera.translation.cast<float>(), direction.cast<float>().normalized(), 0.05f};
  const std::optional<SurfaceHit> hit = city.tracer->intersect(ray);
  if (!hit || hit->distance > 500) return std::nullopt;
  const Surface surface = surfaceAt(city.layout, *hit, 0.1f);
  if (surface.gloss > 0.2f) return std::nullopt;
  const Vec3d x = hit->position.cast<double>();

  Track track;
  double nearest = 1e9;
  for (uint32_t p = 0; p < capture.photos.size(); ++p) {
    const Pose& pose = capture.photos[p].worldFromCamera;
    const Vec3d inCamera = pose.inverse() * x;
    if (inCamera.z() < 1 || inCamera.norm() > 500) continue;
    const std::optional<Vec2d> pixel = camera.pixelFromCamera(inCamera);
    if (!pixel) continue;
    const RandomStream own(random.key, 16 + p);
    Vec2d seen = *pixel + options.pixelNoise * Vec2d(gaussian(own, 0), gaussian(own, 1));
    if (own.uniformDouble(20) < options.wrongMatches) {
      const double angle = 2 * std::numbers::pi * own.uniformDouble(21);
      seen += (3 + 9 * own.uniformDouble(22)) * Vec2d(std::cos(angle), std::sin(angle));
    }
    if (seen.x() < 0 || seen.y() < 0 || seen.x() >= camera.width || seen.y() >= camera.height) continue;
    if (own.uniformDouble(23) > options.detection || !visible(city, pose.translation, x)) continue;
    nearest = std::min(nearest, inCamera.z());
    track.observations.push_back({p, 0, static_cast<float>(seen.x()), static_cast<float>(seen.y()), 0});
  }
  if (track.observations.size() < 3) return std::nullopt;

  // Triangulation averages the keypoints' noise over the track.
  const double sigma =
      options.pixelNoise * nearest / camera.focalX() / std::sqrt(static_cast<double>(track.observations.size()));
  Vec3d error = sigma * Vec3d(gaussian(random, 100), gaussian(random, 101), 1.8 * gaussian(random, 102));
  if (random.uniformDouble(300) < options.wrongPoints)
    error += 3 * Vec3d(gaussian(random, 103), gaussian(random, 104), gaussian(random, 105));
  track.point.xInWorld = x + error;
  track.point.colour =
      developed(lightAlong(city, nullptr, ray, static_cast<float>(1 / camera.focalX()), {0.5f, 0.5f}).radiance, 0);
  double sum = 0;
  for (Observation& o : track.observations) {
    const std::optional<Vec2d> pixel =
        camera.pixelFromCamera(capture.photos[o.photo].worldFromCamera.inverse() * track.point.xInWorld);
    o.error = pixel ? static_cast<float>((*pixel - Vec2d(o.x, o.y)).norm()) : 0;
    sum += o.error;
  }
  track.point.error = static_cast<float>(sum / static_cast<double>(track.observations.size()));
  return track;
}

}  // namespace

void findTracks(const CityScene& city, const LensTable& lens, const TrackOptions& options, ThreadPool& pool,
                Capture& capture) {
  const size_t trackCount = std::min<size_t>(options.maxPoints, capture.photos.size() * options.pointsPerPhoto);
  std::vector<std::optional<Track>> tracks(trackCount);
  pool.forRanges(trackCount, 64, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) tracks[i] = follow(city, lens, capture, options, i);
  });
  for (const std::optional<Track>& track : tracks) {
    if (!track) continue;
    const uint32_t point = static_cast<uint32_t>(capture.points.size());
    capture.points.push_back(track->point);
    for (Observation o : track->observations) {
      o.point = point;
      capture.observations.push_back(o);
    }
  }
  std::stable_sort(capture.observations.begin(), capture.observations.end(),
                   [](const Observation& a, const Observation& b) { return a.photo < b.photo; });
}

}  // namespace tessera
