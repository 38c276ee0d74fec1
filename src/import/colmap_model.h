// Reads COLMAP sparse models, text and binary.
// Source: COLMAP's documentation of its output format (cameras, images, points3D) and its camera models.
#pragma once

#include <array>
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

// A model as its files state it: ids are neither contiguous nor sorted, poses are camera-from-world.
struct ColmapModel {
  struct Keypoint {
    double x = 0, y = 0;
    uint64_t point = 0;  // id; keypoints without a point are left out
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
  std::unordered_map<uint32_t, std::string> unusable;  // cameras whose lens is not supported → the lens's name
  std::vector<Image> images;
  std::vector<Point> points;
};

// Decode untrusted bytes. Return nothing if they are not a model, with the reason and its location in `reason`. Memory
// is bounded by the length of the input, whatever counts it states.
std::optional<ColmapModel> decodeColmapBinary(std::span<const std::byte> cameras, std::span<const std::byte> images,
                                              std::span<const std::byte> points, std::string& reason);
std::optional<ColmapModel> decodeColmapText(std::string_view cameras, std::string_view images, std::string_view points,
                                            std::string& reason);

// Returns a camera from COLMAP's model name or number and its parameters, or nothing, with the reason in `reason`, for
// an unsupported lens, a wrong number of parameters, an empty size, or parameters outside any plausible range. Fisheye
// lenses without distortion become OPENCV_FISHEYE.
std::optional<Camera> colmapCamera(std::string_view model, uint64_t width, uint64_t height,
                                   std::span<const double> parameters, std::string& reason);
std::optional<Camera> colmapCamera(int model, uint64_t width, uint64_t height, std::span<const double> parameters,
                                   std::string& reason);
int colmapParameterCount(int model);             // -1 for an unknown model
std::string_view colmapUnusableLens(int model);  // name of a model whose parameters can be skipped but not used, or ""
bool isColmapLens(std::string_view model);       // whether colmapCamera supports it

// Converts a model into a capture: poses, points, and tracks as observations, each with its own reprojection error.
// Image paths become `imageFolder`/name. Drops photos whose camera is missing or unusable, whose pose is not finite or
// implausibly far away, or whose name leaves the folder, with a warning. `maskFolder`: that of findMask; empty: none.
SourceCapture captureFromColmap(const ColmapModel& model, const fs::path& imageFolder, const fs::path& maskFolder = {});

// Returns the names that the mask of the photo a/b.jpg may have in a folder of masks: a/b.jpg.png (COLMAP's
// convention), a/b.jpg and a/b.png.
std::array<std::string, 3> maskNames(const std::string& name);
// Returns the mask of a photo in a folder of masks, which must lie inside the folder; an empty path if there is none.
fs::path findMask(const fs::path& maskFolder, const std::string& name);

// Returns the folder of the sparse model in a source folder (sparse/0, sparse, colmap/sparse/0, or the folder itself;
// that with the most photos of several numbered ones), or nothing if it has none.
std::optional<fs::path> findColmapModel(const fs::path& source);
// Reads the files of a model in a folder. Throws Error naming the file or folder if they cannot be read or decoded.
// Warns if there is no points3D file.
ColmapModel readColmapModel(const fs::path& folder);
// Reads the model of a source folder, with its photos. Throws Error naming the file or folder if it cannot be read or
// decoded. Warns if there is no points3D file.
SourceCapture readColmap(const fs::path& source);

}  // namespace tessera
