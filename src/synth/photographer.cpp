#include "synth/photographer.h"

#include <algorithm>
#include <array>

#include "base/check.h"
#include "base/random.h"

namespace tessera {
namespace {

// Maps radiance to display-linear values in [0, 1): a soft shoulder and some contrast (Narkowicz's fit of ACES).
float toneCurve(float x) {
  x *= 0.37f;
  return clamped(x * (2.51f * x + 0.03f) / (x * (2.43f * x + 0.59f) + 0.14f));
}

float srgbFromLinear(float x) {
  return x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f;
}

// Samples a tent filter with a radius of one pixel, which approximates a lens and a sensor with an antialiasing filter.
double tent(double u) {
  return 0.8 * (u < 0.5 ? std::sqrt(2 * u) - 1 : 1 - std::sqrt(2 - 2 * u));
}

struct Sampler {
  const CityScene& city;
  const TrafficScene* traffic;
  const LensTable& lens;
  const Pose& pose;
  float spread;
  RandomStream random;

  Ray rayAt(double x, double y, float* zShare = nullptr) const {
    const Eigen::Vector2d slope = lens.slopeAt(x, y);
    const Vec3d inCamera = Vec3d(slope.x(), slope.y(), 1).normalized();
    if (zShare != nullptr) *zShare = static_cast<float>(inCamera.z());
    return {pose.translation.cast<float>(), (pose.rotation * inCamera).cast<float>().normalized(), 0.05f};
  }

  // Sample `i` of a pixel: a low-discrepancy sequence (Roberts' R2), shifted differently in each pixel.
  RayLight sample(int x, int y, uint64_t pixel, int i) const {
    const double u = random.uniformDouble(pixel * 4), v = random.uniformDouble(pixel * 4 + 1);
    const double a = u + 0.7548776662466927 * i, b = v + 0.5698402909980532 * i;
    const double c = random.uniformDouble(pixel * 4 + 2) + 0.8191725133961645 * i,
                 d = random.uniformDouble(pixel * 4 + 3) + 0.6710436067037893 * i;
    const Ray ray = rayAt(x + 0.5 + tent(a - std::floor(a)), y + 0.5 + tent(b - std::floor(b)));
    return lightAlong(city, traffic, ray, spread,
                      {static_cast<float>(c - std::floor(c)), static_cast<float>(d - std::floor(d))});
  }
};

}  // namespace

LensTable::LensTable(const Camera& camera) : camera_(camera) {
  corners_.reserve(static_cast<size_t>(camera.width + 3) * (camera.height + 3));
  for (int y = -1; y <= camera.height + 1; ++y) {
    for (int x = -1; x <= camera.width + 1; ++x) {
      const std::optional<Vec3d> direction = camera.directionInCamera({x, y});
      CHECK(direction.has_value());
      corners_.emplace_back(direction->x() / direction->z(), direction->y() / direction->z());
    }
  }
}

Eigen::Vector2d LensTable::slopeAt(double x, double y) const {
  const int ix = std::clamp(static_cast<int>(std::floor(x)), -1, camera_.width);
  const int iy = std::clamp(static_cast<int>(std::floor(y)), -1, camera_.height);
  const double fx = x - ix, fy = y - iy;
  const Eigen::Vector2d* row = &corners_[static_cast<size_t>(iy + 1) * (camera_.width + 3) + (ix + 1)];
  const Eigen::Vector2d* next = row + camera_.width + 3;
  return (row[0] * (1 - fx) + row[1] * fx) * (1 - fy) + (next[0] * (1 - fx) + next[1] * fx) * fy;
}

std::array<uint8_t, 3> developed(const Vec3f& radiance, double exposure) {
  const float gain = static_cast<float>(std::exp2(exposure));
  std::array<uint8_t, 3> bytes{};
  for (int i = 0; i < 3; ++i)
    bytes[i] = static_cast<uint8_t>(std::lround(255 * srgbFromLinear(clamped(toneCurve(radiance[i]) * gain))));
  return bytes;
}

Exposed takePhoto(const Moment& moment, const LensTable& lens, const Pose& worldFromCamera,
                  const ShutterOptions& options, ThreadPool& pool) {
  const Camera& camera = lens.camera();
  Exposed result{ImageU8(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                 ImageU8(camera.width, camera.height, 1, 255)};
  const Sampler sampler{moment.city,
                        moment.traffic,
                        lens,
                        worldFromCamera,
                        static_cast<float>(1 / camera.focalX()),
                        RandomStream(options.seed, 3)};
  pool.run(camera.height, [&](size_t row, int) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < camera.width; ++x) {
      const uint64_t pixel = static_cast<uint64_t>(y) * camera.width + x;
      Vec3f sum = Vec3f::Zero();
      float darkest = 1e9f, brightest = 0;
      bool touched = false;
      const auto expose = [&](int from, int to) {
        for (int i = from; i < to; ++i) {
          const RayLight light = sampler.sample(x, y, pixel, i);
          // Averages after the tone curve: a bright glint covers no more than its fraction of a pixel.
          const Vec3f shown(toneCurve(light.radiance.x()), toneCurve(light.radiance.y()),
                            toneCurve(light.radiance.z()));
          sum += shown;
          darkest = std::min(darkest, shown.mean());
          brightest = std::max(brightest, shown.mean());
          touched |= light.touchedTraffic;
        }
      };
      int count = options.samplesPerPixel;
      expose(0, count);
      if (brightest - darkest > 0.05f) {
        expose(count, 3 * count);
        count *= 3;
      }
      const Vec3f mean = sum / static_cast<float>(count);
      const float gain = static_cast<float>(std::exp2(options.exposure));
      for (int i = 0; i < 3; ++i)
        result.colour.at(x, y)[i] = static_cast<uint8_t>(std::lround(255 * srgbFromLinear(clamped(mean[i] * gain))));
      float zShare = 1;
      bool moving = false;
      const Ray centre = sampler.rayAt(x + 0.5, y + 0.5, &zShare);
      const std::optional<SurfaceHit> hit = firstHit(moment.city, moment.traffic, centre, &moving);
      *result.depth.at(x, y) = hit ? hit->distance * zShare : 0.f;
      if (touched || moving) *result.mask.at(x, y) = 0;
    }
  });
  return result;
}

}  // namespace tessera
