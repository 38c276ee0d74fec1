#include "import/transforms_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "import/colmap_model.h"

namespace tessera {
namespace {

using Json = nlohmann::json;

constexpr std::array kIntrinsicKeys = {
    "w",  "h",  "fl_x",           "fl_y",           "cx",    "cy",   "k1", "k2", "k3", "k4", "k5", "k6",
    "p1", "p2", "camera_angle_x", "camera_angle_y", "x_fov", "y_fov"};

constexpr std::pair<const char*, Split> kSplitKeys[] = {
    {"train_filenames", Split::train}, {"val_filenames", Split::validation}, {"test_filenames", Split::test}};

// The other keys that are read below, of the file and of its frames.
constexpr std::array kReadKeys = {"frames",        "file_path",         "transform_matrix", "mask_path",
                                  "depth_path",    "depth_file_path",   "camera_model",     "is_fisheye",
                                  "ply_file_path", "applied_transform", "applied_scale",    "integer_depth_scale",
                                  "tessera",       "ftheta_p0",         "ftheta_p1",        "ftheta_p2",
                                  "ftheta_p3",     "ftheta_p4",         "latlong",          "equirectangular"};

// Keys that other programs write for their own use and that have no effect here.
constexpr std::array kOthersKeys = {
    // instant-ngp
    "aabb_scale", "aabb", "render_aabb", "scale", "offset", "up", "n_frames", "sharpness",
    "sharpness_discard_threshold", "sharpen", "envmap", "white_transparent", "black_transparent", "fix_premult",
    "importance_sampling", "enable_ray_loading", "enable_depth_loading", "n_extra_learnable_dims", "driver_parameters",
    // nerfstudio
    "colmap_im_id", "orientation_override",
    // Blender
    "rotation", "near", "far"};

// Keys with a meaning that is not supported, and the consequence.
constexpr std::pair<const char*, const char*> kUnmetKeys[] = {
    {"rolling_shutter", "every photo is treated as exposed at one instant"},
    {"transform_matrix_start", "every photo is treated as exposed at one instant"},
    {"transform_matrix_end", "every photo is treated as exposed at one instant"},
    {"from_na", "poses are read with OpenGL axes"},
    {"normal_mts_args", "poses are read with OpenGL axes"},
    {"fisheye_crop_radius", "what lies outside the circle is trained on unless masks hide it"},
    {"time", "the scene is treated as static"}};

// Bounds of applied_scale and applied_transform. Values outside them are mistakes.
constexpr double kTiny = 1e-12, kHuge = 1e12;

// Replaces NaN, Infinity and -Infinity, which Python writes but JSON does not allow, by null (which is read as NaN).
std::string withoutPythonNumbers(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  bool inString = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (inString) {
      if (c == '\\' && i + 1 < text.size()) {
        out += c;
        out += text[++i];
        continue;
      }
      inString = c != '"';
    } else if (c == '"') {
      inString = true;
    } else {
      bool replaced = false;
      for (const std::string_view word : {"NaN", "-Infinity", "Infinity"}) {
        if (!replaced && text.substr(i, word.size()) == word) {
          out += "null";
          i += word.size() - 1;
          replaced = true;
        }
      }
      if (replaced) continue;
    }
    out += c;
  }
  return out;
}

double numberOr(const Json& object, const char* key, double otherwise) {
  const auto entry = object.find(key);
  return entry != object.end() && entry->is_number() ? entry->get<double>() : otherwise;
}

std::string textOr(const Json& object, const char* key) {
  const auto entry = object.find(key);
  return entry != object.end() && entry->is_string() ? entry->get<std::string>() : std::string();
}

// Returns the object at that key, or an empty one.
const Json& objectAt(const Json& object, const char* key) {
  static const Json kNone = Json::object();
  const auto entry = object.find(key);
  return entry != object.end() && entry->is_object() ? *entry : kNone;
}

// Reads a matrix of 3×4 or 4×4 numbers; elements that are not numbers become NaN.
std::optional<Mat4d> readMatrix(const Json& object, const char* key) {
  const auto rows = object.find(key);
  if (rows == object.end() || !rows->is_array() || (rows->size() != 3 && rows->size() != 4)) return std::nullopt;
  Mat4d matrix = Mat4d::Identity();
  for (size_t r = 0; r < rows->size(); ++r) {
    const Json& row = (*rows)[r];
    if (!row.is_array() || row.size() != 4) return std::nullopt;
    for (size_t c = 0; c < 4; ++c) {
      matrix(static_cast<Eigen::Index>(r), static_cast<Eigen::Index>(c)) =
          row[c].is_number() ? row[c].get<double>() : std::nan("");
    }
  }
  return matrix;
}

// The same of a finite affine map. Its last row is made exact: earlier versions wrote it with a rounding error.
std::optional<Mat4d> readAffineMap(const Json& object, const char* key) {
  auto matrix = readMatrix(object, key);
  if (!matrix || !matrix->allFinite()) return std::nullopt;
  matrix->row(3) << 0, 0, 0, 1;
  return matrix;
}

// Returns whether the value is null, false, 0, or a list of these.
bool saysNothing(const Json& value) {
  const auto isNothing = [](const Json& v) {
    return v.is_null() || (v.is_boolean() && !v.get<bool>()) || (v.is_number() && v.get<double>() == 0);
  };
  return value.is_array() ? std::all_of(value.begin(), value.end(), isNothing) : isNothing(value);
}

void noteKeys(const Json& object, TransformsFile& file) {
  static const std::set<std::string_view> kKnown = [] {
    std::set<std::string_view> known(kIntrinsicKeys.begin(), kIntrinsicKeys.end());
    known.insert(kReadKeys.begin(), kReadKeys.end());
    known.insert(kOthersKeys.begin(), kOthersKeys.end());
    for (const auto& [key, split] : kSplitKeys) known.insert(key);
    return known;
  }();
  for (const auto& [key, value] : object.items()) {
    if (kKnown.contains(key)) continue;
    const auto unmet = std::find_if(std::begin(kUnmetKeys), std::end(kUnmetKeys),
                                    [&key = key](const auto& entry) { return key == entry.first; });
    if (unmet == std::end(kUnmetKeys)) {
      file.unknownKeys.insert(key);
    } else if (!saysNothing(value)) {
      file.unmetKeys[key] = unmet->second;
    }
  }
}

void readIntrinsics(const Json& object, Intrinsics& intrinsics) {
  for (const char* key : kIntrinsicKeys) {
    const double value = numberOr(object, key, std::nan(""));
    if (std::isfinite(value)) intrinsics.numbers[key] = value;
  }
  if (const std::string model = textOr(object, "camera_model"); !model.empty()) intrinsics.model = model;
  const auto fisheye = object.find("is_fisheye");
  if (fisheye != object.end() && fisheye->is_boolean()) intrinsics.fisheye = fisheye->get<bool>();
  // instant-ngp specifies some lenses by keys of their own, which take precedence.
  std::string lens = object.contains("ftheta_p0") ? "FTHETA" : "";
  for (const auto& [key, model] : {std::pair{"latlong", "LATLONG"}, std::pair{"equirectangular", "EQUIRECTANGULAR"}}) {
    if (const auto value = object.find(key); value != object.end() && !saysNothing(*value)) lens = model;
  }
  if (lens.empty()) return;
  intrinsics.model = lens;
  intrinsics.fisheye = false;
}

void readSplits(const Json& json, TransformsFile& file) {
  for (const auto& [key, split] : kSplitKeys) {
    const auto names = json.find(key);
    if (names == json.end() || !names->is_array()) continue;
    SplitList list{key, split, {}};
    for (const Json& name : *names) {
      if (name.is_string()) list.names.push_back(name.get<std::string>());
    }
    file.splitLists.push_back(std::move(list));
  }
}

// Returns whether the transform can be inverted with coordinates staying in bounds. The determinant of a similarity is
// the cube of its scale, so the matrix is normalised by its scale before the determinant is tested.
bool isInvertible(const Mat4d& applied) {
  const Mat3d linear = applied.topLeftCorner<3, 3>();
  const double size = linear.norm() / std::sqrt(3.0);
  return applied.allFinite() && applied.row(3) == Mat4d::Identity().row(3) && size >= kTiny && size <= kHuge &&
         std::abs((linear / size).determinant()) > 1e-6 &&
         applied.topRightCorner<3, 1>().cwiseAbs().maxCoeff() <= kHuge;
}

void readApplied(const Json& json, TransformsFile& file) {
  if (const auto scale = json.find("applied_scale"); scale != json.end() && !scale->is_null()) {
    const double value = numberOr(json, "applied_scale", 0);
    if (value >= kTiny && value <= kHuge) {
      file.appliedScale = value;
    } else {
      file.appliedTrouble = "applied_scale is not a number from 1e-12 to 1e12";
    }
  }
  if (const auto matrix = json.find("applied_transform"); matrix != json.end() && !matrix->is_null()) {
    const auto applied = readMatrix(json, "applied_transform");
    if (applied && isInvertible(*applied)) {
      file.appliedTransform = *applied;
    } else {
      file.appliedTrouble = "applied_transform is not a 3 x 4 matrix that can be inverted";
    }
  }
}

bool readOurs(const Json& ours, TransformsFile& file, std::string& reason) {
  file.isOurs = true;
  if (numberOr(ours, "version", 1) > 1) {
    reason = "tessera.version: written by a newer tessera";
    return false;
  }
  const auto cameras = ours.find("cameras");
  if (cameras != ours.end() && cameras->is_array()) {
    for (const Json& camera : *cameras) {
      std::vector<double> parameters;
      std::string why = "is not a camera";
      std::optional<Camera> decoded;
      if (camera.is_object() && camera.contains("parameters") && camera["parameters"].is_array()) {
        for (const Json& p : camera["parameters"]) parameters.push_back(p.is_number() ? p.get<double>() : std::nan(""));
        const auto side = [&camera](const char* key) {
          const double value = numberOr(camera, key, 0);
          return value > 0 && value < 1e9 ? static_cast<uint64_t>(value) : uint64_t{0};
        };
        decoded = colmapCamera(textOr(camera, "model"), side("width"), side("height"), parameters, why);
      }
      if (!decoded) {
        reason = fmt::format("tessera.cameras[{}]: {}", file.cameras.size(), why);
        return false;
      }
      file.cameras.push_back(*decoded);
    }
  }
  if (const auto matrix = readAffineMap(ours, "source_from_world")) file.sourceFromWorld = *matrix;
  const Json& geo = objectAt(ours, "geo");
  if (const auto matrix = readAffineMap(geo, "enu_from_world")) {
    file.geo =
        GeoFrame{numberOr(geo, "latitude", 0), numberOr(geo, "longitude", 0), numberOr(geo, "altitude", 0), *matrix};
  }
  file.observationFile = textOr(ours, "observations");
  return true;
}

bool readFrame(const Json& object, const Intrinsics& shared, TransformsFile& file, std::string& reason) {
  const size_t index = file.frames.size();
  TransformsFrame frame;
  if (object.is_object()) frame.file = textOr(object, "file_path");
  auto matrix = object.is_object() ? readMatrix(object, "transform_matrix") : std::nullopt;
  // Of photos with a rolling shutter, instant-ngp has the pose at the start.
  if (!matrix && object.is_object()) matrix = readMatrix(object, "transform_matrix_start");
  if (frame.file.empty() || !matrix) {
    reason = fmt::format("frames[{}]: has no {}", index, frame.file.empty() ? "file_path" : "4 x 4 transform_matrix");
    return false;
  }
  noteKeys(object, file);
  file.isOfColmap |= object.contains("colmap_im_id");
  frame.worldFromCameraGl = *matrix;
  frame.mask = textOr(object, "mask_path");
  frame.depth = textOr(object, "depth_file_path");
  if (frame.depth.empty()) frame.depth = textOr(object, "depth_path");  // instant-ngp
  frame.intrinsics = shared;
  readIntrinsics(object, frame.intrinsics);
  if (file.isOurs) {
    const Json& ours = objectAt(object, "tessera");
    const double camera = numberOr(ours, "camera", -1);
    if (camera >= 0 && camera < static_cast<double>(file.cameras.size())) frame.camera = static_cast<int>(camera);
    frame.name = textOr(ours, "name");
    if (ours.contains("exposure")) frame.exposure = numberOr(ours, "exposure", 0);
    const double orientation = numberOr(ours, "orientation", 1);
    if (orientation >= 1 && orientation <= 8) frame.orientation = static_cast<int>(orientation);
    const double unit = numberOr(ours, "depth_unit", 0);
    frame.depthUnit = unit > 0 && unit < 1e30 ? static_cast<float>(unit) : 0.0f;
    const Json& gps = objectAt(ours, "gps");
    const double latitude = numberOr(gps, "latitude", std::nan("")),
                 longitude = numberOr(gps, "longitude", std::nan(""));
    if (std::abs(latitude) <= 90 && std::abs(longitude) <= 360) {
      frame.gps = GpsFix{latitude, longitude, numberOr(gps, "altitude", 0), numberOr(gps, "relative_altitude", 0),
                         gps.contains("altitude")};
    }
  }
  file.frames.push_back(std::move(frame));
  return true;
}

double numberAt(const Intrinsics& intrinsics, const char* key, double otherwise) {
  const auto entry = intrinsics.numbers.find(key);
  return entry == intrinsics.numbers.end() ? otherwise : entry->second;
}

// Returns the focal length along an axis: fl, else from an angle in radians, else from one in degrees; 0 if none is
// given.
double readFocalLength(const Intrinsics& i, const char* focal, const char* radians, const char* degrees, double size) {
  if (const double f = numberAt(i, focal, 0); f > 0) return f;
  double angle = numberAt(i, radians, 0);
  if (!(angle > 0)) angle = numberAt(i, degrees, 0) * M_PI / 180;
  return angle > 0 && angle < 3.14 ? size / (2 * std::tan(angle / 2)) : 0;
}

}  // namespace

std::optional<TransformsFile> decodeTransforms(std::string_view text, std::string& reason) {
  Json json = Json::parse(text, nullptr, false, true);
  if (json.is_discarded()) json = Json::parse(withoutPythonNumbers(text), nullptr, false, true);
  if (!json.is_object()) {
    reason = json.is_discarded() ? "is not JSON" : "is not a JSON object";
    return std::nullopt;
  }
  TransformsFile file;
  if (const auto ours = json.find("tessera"); ours != json.end() && ours->is_object()) {
    if (!readOurs(*ours, file, reason)) return std::nullopt;
  }
  noteKeys(json, file);
  Intrinsics shared;
  readIntrinsics(json, shared);
  const auto frames = json.find("frames");
  if (frames == json.end() || !frames->is_array()) {
    reason = "frames: is missing";
    return std::nullopt;
  }
  for (const Json& frame : *frames) {
    if (!readFrame(frame, shared, file, reason)) return std::nullopt;
  }
  file.pointFile = textOr(json, "ply_file_path");
  readSplits(json, file);
  readApplied(json, file);
  const double step = numberOr(json, "integer_depth_scale", 0);
  if (step > 0 && std::isfinite(step)) file.integerDepthScale = step;
  return file;
}

std::optional<Camera> cameraFromIntrinsics(const Intrinsics& intrinsics, int photoWidth, int photoHeight,
                                           std::string& reason) {
  const auto at = [&](const char* key) { return numberAt(intrinsics, key, 0); };
  double w = at("w"), h = at("h");
  if (!(w >= 1) || !(h >= 1)) {
    w = photoWidth;
    h = photoHeight;
  }
  double fx = readFocalLength(intrinsics, "fl_x", "camera_angle_x", "x_fov", w);
  double fy = readFocalLength(intrinsics, "fl_y", "camera_angle_y", "y_fov", h);
  if (fx <= 0) fx = fy;
  if (fy <= 0) fy = fx;
  if (!(fx > 0) || !(w < 1e6) || !(h < 1e6)) {
    reason = "has no focal length (fl_x, camera_angle_x or x_fov)";
    return std::nullopt;
  }
  std::vector<double> parameters = {fx, fy, numberAt(intrinsics, "cx", w / 2), numberAt(intrinsics, "cy", h / 2)};
  const auto append = [&](std::initializer_list<const char*> keys) {
    for (const char* key : keys) parameters.push_back(at(key));
  };
  // The model is determined by its name, then by which coefficients are not zero.
  std::string model = intrinsics.model;
  if (model == "SIMPLE_RADIAL" || model == "RADIAL" || model == "PERSPECTIVE" || model.empty()) model = "OPENCV";
  if (model == "SIMPLE_PINHOLE") model = "PINHOLE";
  if (intrinsics.fisheye || model == "SIMPLE_RADIAL_FISHEYE" || model == "RADIAL_FISHEYE") model = "OPENCV_FISHEYE";
  if (model == "OPENCV") {
    if (at("k4") != 0) {
      reason = "k4 of a perspective lens (a term in r^8) is not supported: refine the lens without it";
      return std::nullopt;
    }
    if (at("k3") != 0) {
      model = "FULL_OPENCV";
    } else if (at("k1") == 0 && at("k2") == 0 && at("p1") == 0 && at("p2") == 0) {
      model = "PINHOLE";
    }
  }
  if (model == "OPENCV_FISHEYE") {
    append({"k1", "k2", "k3", "k4"});
  } else if (model == "OPENCV") {
    append({"k1", "k2", "p1", "p2"});
  } else if (model == "FULL_OPENCV") {
    append({"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"});
  } else if (model != "PINHOLE") {
    reason = fmt::format("camera_model {} is not supported here", model);
    return std::nullopt;
  }
  return colmapCamera(model, static_cast<uint64_t>(std::llround(w)), static_cast<uint64_t>(std::llround(h)), parameters,
                      reason);
}

}  // namespace tessera
