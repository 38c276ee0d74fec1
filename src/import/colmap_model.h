// COLMAP sparse models, text and binary.
// Source: COLMAP's documentation of its output format (cameras, images, points3D) and its camera models.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "base/file.h"
#include "import/source.h"

namespace tessera {

// As the files say it: ids neither contiguous nor sorted, poses camera-from-world.
struct ColmapModel {
  struct Keypoint {
    double x = 0, y = 0;
    uint64_t point = 0;  // id; only keypoints that belong to a point are kept
  };
  struct Image {
    uint32_t id = 0, camera = 0;
    std::array<double, 4> quaternion{};  // w, x, y, z
    std::array<double, 3> translation{};
    std::string name;
    std::vector<Keypoint> keypoints;
  };
  struct Point {
    uint64_t id = 0;
    SparsePoint point;
  };
  std::unordered_map<uint32_t, Camera> cameras;
  std::unordered_map<uint32_t, std::string> unusable;  // cameras whose lens is not known here: the lens's name
  std::vector<Image> images;
  std::vector<Point> points;
};

// Untrusted bytes: nothing, with why and where in `reason`, for what is not a model. Memory is bounded by the length of
// the input, whatever its counts say.
std::optional<ColmapModel> decodeColmapBinary(std::span<const std::byte> cameras, std::span<const std::byte> images,
                                              std::span<const std::byte> points, std::string& reason);
std::optional<ColmapModel> decodeColmapText(std::string_view cameras, std::string_view images, std::string_view points,
                                            std::string& reason);

// A camera from COLMAP's model name or number and its parameters; nothing for another lens, another number of
// parameters, no size, or numbers that are absurd. Fisheye lenses without distortion are taken as OPENCV_FISHEYE.
std::optional<Camera> colmapCamera(std::string_view model, uint64_t width, uint64_t height,
                                   std::span<const double> parameters, std::string& reason);
std::optional<Camera> colmapCamera(int model, uint64_t width, uint64_t height, std::span<const double> parameters,
                                   std::string& reason);
int colmapParameterCount(int model);             // -1 for a model that is not known
std::string_view colmapUnusableLens(int model);  // name of a model whose parameters can be skipped but not used, or ""
bool isColmapLens(std::string_view model);       // whether colmapCamera knows it

// Poses, points, and tracks as observations with each one's own reprojection error. Image paths become
// `imageFolder`/name; photos whose camera is missing or unusable, whose pose is absurd, or whose name leaves the folder
// are dropped with a warning.
SourceCapture captureFromColmap(const ColmapModel& model, const fs::path& imageFolder);

// The folder of the sparse model in a source folder (sparse/0, sparse, colmap/sparse/0, or itself), if it has one.
std::optional<fs::path> findColmapModel(const fs::path& source);
SourceCapture readColmap(const fs::path& source);

}  // namespace tessera
