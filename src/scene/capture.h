// A capture: posed photographs of one place. Plain data; photos stay on disk until asked for.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "scene/axes.h"
#include "scene/camera.h"

namespace tessera {

enum class Split { train, validation, test };

struct GpsFix {
  double latitude = 0, longitude = 0;  // degrees, WGS 84
  double altitude = 0;                 // metres above the ellipsoid (or the sea, as the photo's EXIF gives it)
  double relativeAltitude = 0;         // metres above take-off, 0 when unknown
};

struct Photo {
  std::string name;             // path relative to the capture, unique; what reports call it
  int camera = 0;               // index into Capture::cameras
  Pose worldFromCamera;         // in the capture's recentred world
  std::filesystem::path image;  // absolute or relative to the working folder, checked to be inside the capture
  std::filesystem::path mask;   // 1-channel picture, black = do not train on; empty when there is none
  std::filesystem::path depth;  // EXR (world units) or 16-bit PNG of z-depth along the optical axis; may be empty
  float depthUnit = 0.001f;     // world units per step of an integer depth PNG
  Split split = Split::train;
  double exposure = 0;  // log2 gain relative to the capture's mean, 0 when unknown
  std::optional<GpsFix> gps;
};

// A structure-from-motion point.
struct SparsePoint {
  Vec3d xInWorld = Vec3d::Zero();
  std::array<uint8_t, 3> colour{};
  float error = 0;  // mean reprojection error, pixels
};

// "Photo p saw point q at this pixel": what pseudo-depth is made from.
struct Observation {
  uint32_t photo = 0;
  uint32_t point = 0;
  float x = 0, y = 0;  // pixel, in the photo's own resolution
  float error = 0;     // reprojection error, pixels
};

// Where the recentred world lies on the Earth: an east-north-up frame at an origin.
struct GeoFrame {
  double latitude = 0, longitude = 0, altitude = 0;
  Mat4d enuFromWorld = Mat4d::Identity();  // similarity; metres
};

struct Capture {
  std::filesystem::path root;
  std::vector<Camera> cameras;
  std::vector<Photo> photos;  // in natural name order
  std::vector<SparsePoint> points;
  std::vector<Observation> observations;  // sorted by photo
  std::optional<GeoFrame> geo;

  // Similarity from this world to the one the photos' poses came in. Import recentres, so that float kernels see small
  // numbers, turns Z up, and with GPS makes the unit a metre; a capture made by ourselves is its own source.
  Mat4d sourceFromWorld = Mat4d::Identity();

  std::vector<int> photosIn(Split split) const;
};

}  // namespace tessera
