#include "scene/camera_path.h"

#include <fmt/format.h>

#include <Eigen/SVD>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/error.h"
#include "base/log.h"
#include "base/text_place.h"

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

// Parses a text. Returns null, and sets the flaw, if it is not JSON.
json parsed(std::string_view text, TextFlaw& flaw) {
  try {
    return json::parse(text);
  } catch (const json::parse_error& error) {
    flaw = {placeInText(text, error.byte), "is not JSON"};
  } catch (const json::out_of_range&) {
    flaw = {"", "contains a number that is too large"};
  }
  return {};
}

// Throws TextFlaw.
double requireNumber(const json& object, const std::string& of, const char* key, double absent, double low,
                     double high) {
  const auto number = finiteNumber(object, key, absent);
  if (number && *number >= low && *number <= high) return *number;
  throw TextFlaw{of + key, fmt::format("is not a number from {} to {}", low, high)};
}

// Throws TextFlaw.
Pose requirePose(const json& frame, const std::string& place) {
  const auto entry = frame.find("camera_to_world");
  if (entry == frame.end()) throw TextFlaw{place, "has no camera_to_world"};
  const auto matrix = matrixFrom(*entry, 4);
  if (!matrix) throw TextFlaw{place + ".camera_to_world", "is not 16 numbers, in rows"};
  const auto rotation = rotationFrom(matrix->topLeftCorner<3, 3>());
  if (!rotation)
    throw TextFlaw{place + ".camera_to_world", "does not begin with a rotation: it scales, shears or mirrors"};
  return {flippedYz(*rotation), matrix->topRightCorner<3, 1>()};
}

// Throws TextFlaw.
CameraPath requirePath(const json& file) {
  if (!file.is_object()) throw TextFlaw{"", "is not an object of JSON"};
  CameraPath path;
  path.width = static_cast<int>(std::lround(requireNumber(file, "", "render_width", path.width, 1, kLargestSide)));
  path.height = static_cast<int>(std::lround(requireNumber(file, "", "render_height", path.height, 1, kLargestSide)));
  path.framesPerSecond = requireNumber(file, "", "fps", path.framesPerSecond, 1e-3, 1000);
  path.seconds = requireNumber(file, "", "seconds", 0, 0, 1e9);
  if (const auto type = file.find("camera_type"); type != file.end()) {
    if (*type != "perspective" && *type != "fisheye")
      throw TextFlaw{"camera_type", "is neither perspective nor fisheye, which alone are rendered"};
    path.fisheye = *type == "fisheye";
  }
  path.fromViewer = file.contains("keyframes");
  const auto views = file.find("camera_path");
  if (views == file.end() || !views->is_array() || views->empty())
    throw TextFlaw{"camera_path", "is missing, empty, or not a list of frames"};
  for (const json& item : *views) {
    const std::string place = fmt::format("camera_path[{}]", path.views.size());
    if (!item.is_object()) throw TextFlaw{place, "is not an object"};
    path.views.push_back({requirePose(item, place), requireNumber(item, place + ".", "fov", 50, 0.1, 179)});
  }
  return path;
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

std::optional<CameraPath> decodeCameraPath(std::string_view text, TextFlaw* flaw) {
  TextFlaw why;
  try {
    const json file = parsed(text, why);
    if (why.reason.empty()) return requirePath(file);
  } catch (TextFlaw& thrown) {
    why = std::move(thrown);
  }
  if (flaw != nullptr) *flaw = std::move(why);
  return std::nullopt;
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
  TextFlaw flaw;
  auto decoded = decodeCameraPath(readTextFile(path), &flaw);
  if (!decoded) {
    throw Error(path.string(), flaw.place, flaw.reason,
                "correct it, or export the path again from a viewer (tessera's or nerfstudio's)");
  }
  std::error_code status;
  fs::path transforms = dataparserTransforms;
  if (const fs::path beside = path.parent_path() / "dataparser_transforms.json";
      transforms.empty() && fs::exists(beside, status)) {
    if (decoded->fromViewer) {
      transforms = beside;
      inform("{}: followed in the world of {}", path.string(), beside.string());
    } else {
      inform("{}: nerfstudio's viewer did not write it, so that {} is not used; --dataparser-transforms would use it",
             path.string(), beside.string());
    }
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
