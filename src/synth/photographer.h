// Takes one photo: colour as a camera would record it, exact depth, and a mask of what not to train on.
#pragma once

#include "base/image.h"
#include "base/threads.h"
#include "scene/camera.h"
#include "synth/city_scene.h"

namespace tessera {

struct Exposed {
  ImageU8 colour;  // sRGB
  ImageF depth;    // z-depth through pixel centres, metres; 0 where the sky is
  ImageU8 mask;    // 1 channel: 0 where a moving car or its shadow is visible, otherwise 255
};

struct ShutterOptions {
  int samplesPerPixel = 6;  // where the image is even; about three times as many elsewhere
  double exposure = 0;      // log2 gain, applied to linear light after the tone curve: exactly a gain, up to clipping
  uint64_t seed = 0;        // of the sampling pattern
};

// A lookup table of a lens's ray directions, which avoids inverting the lens model for every sample of every photo.
class LensTable {
 public:
  explicit LensTable(const Camera& camera);
  const Camera& camera() const { return camera_; }
  // Returns x/z and y/z in camera axes at a pixel position (up to one pixel outside the image).
  Eigen::Vector2d slopeAt(double x, double y) const;

 private:
  Camera camera_;
  std::vector<Eigen::Vector2d> corners_;  // at whole pixel positions, (width + 3) × (height + 3) from (-1, -1)
};

// The scene at the time of a photo.
struct Moment {
  const CityScene& city;
  const TrafficScene* traffic = nullptr;  // moving cars at that time; null: empty streets
};

// The result does not depend on the number of threads.
Exposed takePhoto(const Moment& moment, const LensTable& lens, const Pose& worldFromCamera,
                  const ShutterOptions& options, ThreadPool& pool);

// Converts linear radiance to 8-bit sRGB, as photos show it.
std::array<uint8_t, 3> developed(const Vec3f& radiance, double exposure);

}  // namespace tessera
