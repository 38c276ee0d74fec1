#include "scene/camera_path.h"

#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/error.h"
#include "base/log.h"

namespace tessera {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr int kLargestSide = 16384;
constexpr double kRotationTolerance = 1e-2;  // of RᵀR from the identity; files round to few digits

std::optional<double> finiteNumber(const json& object, const char* key, double absent) {
  const auto entry = object.find(key);
  if (entry == object.end()) return absent;
  if (!entry->is_number()) return std::nullopt;
  const double value = entry->get<double>();
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

// Reads rows of four numbers, flat or nested; missing rows are those of the identity.
std::optional<Mat4d> matrixFrom(const json& value, size_t rows) {
  Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = Mat4d::Identity();
  size_t count = 0;
  const auto take = [&](const json& number) {
    if (!number.is_number() || count >= 4 * rows) return false;
    const double given = number.get<double>();
    matrix.data()[count++] = given;
    return std::abs(given) < kFarthest;  // false for NaN too
  };
  if (!value.is_array()) return std::nullopt;
  for (const json& item : value) {
    if (item.is_array()) {
      for (const json& number : item) {
        if (!take(number)) return std::nullopt;
      }
    } else if (!take(item)) {
      return std::nullopt;
    }
  }
  return count == 4 * rows ? std::optional<Mat4d>(matrix) : std::nullopt;
}

// Returns the nearest rotation, or nothing if it is not within kRotationTolerance.
std::optional<Mat3d> rotationFrom(const Mat3d& given) {
  if ((given.transpose() * given - Mat3d::Identity()).cwiseAbs().maxCoeff() > kRotationTolerance) return std::nullopt;
  if (given.determinant() < 0) return std::nullopt;
  const Eigen::JacobiSVD<Mat3d> svd(given, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return Mat3d(svd.matrixU() * svd.matrixV().transpose());
}

std::optional<Pose> poseFrom(const json& value) {
  const auto matrix = matrixFrom(value, 4);
  if (!matrix) return std::nullopt;
  const auto rotation = rotationFrom(matrix->topLeftCorner<3, 3>());
  if (!rotation) return std::nullopt;
  return Pose{flippedYz(*rotation), matrix->topRightCorner<3, 1>()};
}

}  // namespace

Camera CameraPath::makeViewCamera(const CameraPathView& view) const {
  const double halfAngle = view.verticalFieldOfView * std::numbers::pi / 360;
  const double focal = 0.5 * height / std::tan(halfAngle);  // nerfstudio uses the same for its fisheye
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.lens = fisheye ? LensModel::openCvFisheye : LensModel::pinhole;
  camera.parameters = {focal, focal, 0.5 * width, 0.5 * height};
  return camera;
}

std::optional<CameraPath> decodeCameraPath(std::string_view text) {
  const json file = json::parse(text, nullptr, false);
  if (!file.is_object()) return std::nullopt;
  CameraPath path;
  const auto width = finiteNumber(file, "render_width", path.width);
  const auto height = finiteNumber(file, "render_height", path.height);
  const auto rate = finiteNumber(file, "fps", path.framesPerSecond);
  const auto seconds = finiteNumber(file, "seconds", 0);
  if (!width || !height || !rate || !seconds) return std::nullopt;
  if (*width < 1 || *height < 1 || *width > kLargestSide || *height > kLargestSide) return std::nullopt;
  if (*rate <= 0 || *rate > 1000 || *seconds < 0) return std::nullopt;
  path.width = static_cast<int>(std::lround(*width));
  path.height = static_cast<int>(std::lround(*height));
  path.framesPerSecond = *rate;
  path.seconds = *seconds;

  if (const auto type = file.find("camera_type"); type != file.end()) {
    if (!type->is_string()) return std::nullopt;
    const auto& name = type->get_ref<const std::string&>();
    if (name != "perspective" && name != "fisheye") return std::nullopt;
    path.fisheye = name == "fisheye";
  }
  path.fromViewer = file.contains("keyframes");
  const auto views = file.find("camera_path");
  if (views == file.end() || !views->is_array() || views->empty()) return std::nullopt;
  for (const json& item : *views) {
    if (!item.is_object()) return std::nullopt;
    const auto matrix = item.find("camera_to_world");
    if (matrix == item.end()) return std::nullopt;
    const auto pose = poseFrom(*matrix);
    const auto angle = finiteNumber(item, "fov", 50);
    if (!pose || !angle || *angle < 0.1 || *angle > 179) return std::nullopt;
    path.views.push_back({*pose, *angle});
  }
  return path;
}

std::optional<Mat4d> decodeDataparserTransforms(std::string_view text) {
  const json file = json::parse(text, nullptr, false);
  if (!file.is_object()) return std::nullopt;
  const auto transform = file.find("transform");
  if (transform == file.end()) return std::nullopt;
  const auto matrix = matrixFrom(*transform, 3);
  const auto scale = finiteNumber(file, "scale", 1);
  if (!matrix || !scale || !(*scale > 1 / kFarthest && *scale < kFarthest)) return std::nullopt;
  const auto rotation = rotationFrom(matrix->topLeftCorner<3, 3>());
  if (!rotation) return std::nullopt;
  Mat4d dataparserFromSource = Mat4d::Identity();
  dataparserFromSource.topLeftCorner<3, 3>() = *scale * *rotation;
  dataparserFromSource.topRightCorner<3, 1>() = *scale * matrix->topRightCorner<3, 1>();
  return dataparserFromSource;
}

Mat4d readDataparserTransforms(const fs::path& path) {
  const auto decoded = decodeDataparserTransforms(readTextFile(path));
  if (!decoded) {
    throw Error(path.string(), "", "does not say how nerfstudio turned and scaled the world",
                "name the dataparser_transforms.json of the training run, with its transform (3x4) and scale");
  }
  return *decoded;
}

CameraPath readCameraPath(const fs::path& path, const fs::path& dataparserTransforms) {
  auto decoded = decodeCameraPath(readTextFile(path));
  if (!decoded) {
    throw Error(path.string(), "", "is not a camera path that can be followed",
                "export it from nerfstudio's viewer as perspective or fisheye, with at least one frame");
  }
  std::error_code status;
  fs::path transforms = dataparserTransforms;
  if (const fs::path beside = path.parent_path() / "dataparser_transforms.json";
      transforms.empty() && fs::exists(beside, status)) {
    transforms = beside;
    inform("{}: followed in the world of {}", path.string(), beside.string());
  }
  if (!transforms.empty()) {
    decoded->pathFromSource = readDataparserTransforms(transforms);
  } else if (decoded->fromViewer) {
    warn(
        "{}: nerfstudio's viewer wrote it, but without its run's dataparser_transforms.json it is followed in the "
        "source's own world; copy that file beside it, or pass --dataparser-transforms",
        path.string());
  }
  return std::move(*decoded);
}

std::string encodeCameraPath(const CameraPath& path) {
  ordered_json views = ordered_json::array();
  for (const CameraPathView& view : path.views) {
    Eigen::Matrix<double, 4, 4, Eigen::RowMajor> matrix = Mat4d::Identity();
    matrix.topLeftCorner<3, 3>() = flippedYz(view.worldFromCamera.rotation);
    matrix.topRightCorner<3, 1>() = view.worldFromCamera.translation;
    views.push_back({{"camera_to_world", std::vector<double>(matrix.data(), matrix.data() + 16)},
                     {"fov", view.verticalFieldOfView},
                     {"aspect", static_cast<double>(path.width) / path.height}});
  }
  const ordered_json file = {{"camera_type", path.fisheye ? "fisheye" : "perspective"},
                             {"render_height", path.height},
                             {"render_width", path.width},
                             {"camera_path", std::move(views)},
                             {"fps", path.framesPerSecond},
                             {"seconds", path.seconds},
                             {"is_cycle", false},
                             {"smoothness_value", 0.0}};
  return file.dump(1) + "\n";
}

void writeCameraPath(const fs::path& file, const CameraPath& path) {
  writeFileAtomically(file, encodeCameraPath(path));
}

}  // namespace tessera
