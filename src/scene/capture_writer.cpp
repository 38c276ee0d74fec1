#include "scene/capture_writer.h"

#include <nlohmann/json.hpp>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/safetensors.h"
#include "scene/ply.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

template <class Matrix>
Json rowsToJson(const Matrix& matrix) {
  Json rows = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    Json row = Json::array();
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) {
      CHECK(std::isfinite(matrix(r, c)));  // JSON cannot represent it
      row.push_back(matrix(r, c));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

// Adds the keys that nerfstudio and instant-ngp read. A lens that these cannot express keeps COLMAP's name, so that
// other programs reject the file instead of rendering with a wrong lens.
void addIntrinsics(Json& json, const Camera& camera) {
  const auto& p = camera.parameters;
  switch (camera.lens) {
    case LensModel::simplePinhole:
    case LensModel::pinhole:
      json["camera_model"] = "PINHOLE";
      break;
    case LensModel::simpleRadial:
    case LensModel::radial:
    case LensModel::openCv:
      json["camera_model"] = "OPENCV";
      break;
    case LensModel::simpleRadialFisheye:
    case LensModel::radialFisheye:
    case LensModel::openCvFisheye:
      json["camera_model"] = "OPENCV_FISHEYE";
      break;
    default:
      json["camera_model"] = lensName(camera.lens);
  }
  json["w"] = camera.width;
  json["h"] = camera.height;
  json["fl_x"] = camera.focalX();
  json["fl_y"] = camera.focalY();
  json["cx"] = camera.centreX();
  json["cy"] = camera.centreY();
  switch (camera.lens) {
    case LensModel::radial:
    case LensModel::radialFisheye:
      json["k2"] = p[4];
      [[fallthrough]];
    case LensModel::simpleRadial:
    case LensModel::simpleRadialFisheye:
      json["k1"] = p[3];
      break;
    case LensModel::openCv:
      json["k1"] = p[4];
      json["k2"] = p[5];
      json["p1"] = p[6];
      json["p2"] = p[7];
      break;
    case LensModel::openCvFisheye:
      for (size_t i = 0; i < 4; ++i) json["k" + std::to_string(i + 1)] = p[4 + i];
      break;
    default:
      break;
  }
}

Json exactCamera(const Camera& camera) {
  Json parameters = Json::array();
  for (int i = 0; i < lensParameterCount(camera.lens); ++i) {
    CHECK(std::isfinite(camera.parameters[static_cast<size_t>(i)]));
    parameters.push_back(camera.parameters[static_cast<size_t>(i)]);
  }
  return {{"model", lensName(camera.lens)},
          {"width", camera.width},
          {"height", camera.height},
          {"parameters", std::move(parameters)}};
}

std::string pathInCapture(const fs::path& root, const fs::path& path) {
  const fs::path realRoot = fs::weakly_canonical(fs::absolute(root));
  const fs::path relative = fs::weakly_canonical(fs::absolute(path)).lexically_relative(realRoot);
  if (relative.empty() || *relative.begin() == "..") {
    throw Error(path.string(), "", "lies outside the capture folder " + root.string(),
                "a capture contains its own photos: copy or link them into it");
  }
  return relative.generic_string();
}

Mat4d poseToMatrix(const Pose& worldFromCamera) {
  Mat4d matrix = Mat4d::Identity();
  matrix.topLeftCorner<3, 3>() = flippedYz(worldFromCamera.rotation);
  matrix.topRightCorner<3, 1>() = worldFromCamera.translation;
  return matrix;
}

Json frameToJson(const Capture& capture, const Photo& photo) {
  CHECK(photo.camera >= 0);
  CHECK(photo.camera < static_cast<int>(capture.cameras.size()));
  Json frame;
  frame["file_path"] = pathInCapture(capture.root, photo.image);
  if (!photo.mask.empty()) frame["mask_path"] = pathInCapture(capture.root, photo.mask);
  if (!photo.depth.empty()) frame["depth_file_path"] = pathInCapture(capture.root, photo.depth);
  if (capture.cameras.size() != 1) addIntrinsics(frame, capture.cameras[static_cast<size_t>(photo.camera)]);
  frame["transform_matrix"] = rowsToJson(poseToMatrix(photo.worldFromCamera));
  Json& ours = frame["tessera"];
  ours["camera"] = photo.camera;
  if (photo.name != frame["file_path"].get<std::string>()) ours["name"] = photo.name;
  if (photo.exposure) ours["exposure"] = *photo.exposure;
  if (photo.orientation != 1) ours["orientation"] = photo.orientation;
  if (!photo.depth.empty()) ours["depth_unit"] = photo.depthUnit;
  if (photo.gps) {
    ours["gps"] = {{"latitude", photo.gps->latitude},
                   {"longitude", photo.gps->longitude},
                   {"relative_altitude", photo.gps->relativeAltitude}};
    if (photo.gps->hasAltitude) ours["gps"]["altitude"] = photo.gps->altitude;
  }
  return frame;
}

template <class T>
TensorView makeTensorView(TensorType type, std::vector<int64_t> shape, const std::vector<T>& values) {
  return {type, std::move(shape), std::as_bytes(std::span(values))};
}

Bytes encodeObservations(const std::vector<Observation>& observations) {
  std::vector<uint32_t> photo, point;
  std::vector<float> pixel, error;
  for (const Observation& observation : observations) {
    photo.push_back(observation.photo);
    point.push_back(observation.point);
    pixel.insert(pixel.end(), {observation.x, observation.y});
    error.push_back(observation.error);
  }
  const auto n = static_cast<int64_t>(observations.size());
  return encodeSafetensors({{"photo", makeTensorView(TensorType::u32, {n}, photo)},
                            {"point", makeTensorView(TensorType::u32, {n}, point)},
                            {"pixel", makeTensorView(TensorType::f32, {n, 2}, pixel)},
                            {"error", makeTensorView(TensorType::f32, {n}, error)}});
}

}  // namespace

void writeCapture(const Capture& capture) {
  Json json;
  if (capture.cameras.size() == 1) addIntrinsics(json, capture.cameras[0]);
  if (!capture.points.empty()) {
    json["ply_file_path"] = "points.ply";
    writeFileAtomically(capture.root / "points.ply", encodePly(capture.points), true);
  }
  Json frames = Json::array();
  std::array<Json, 3> names = {Json::array(), Json::array(), Json::array()};
  for (const Photo& photo : capture.photos) {
    frames.push_back(frameToJson(capture, photo));
    names[static_cast<size_t>(photo.split)].push_back(frames.back()["file_path"]);
  }
  json["train_filenames"] = std::move(names[0]);
  json["val_filenames"] = std::move(names[1]);
  json["test_filenames"] = std::move(names[2]);

  Json& ours = json["tessera"];
  ours["version"] = 1;
  ours["cameras"] = Json::array();
  for (const Camera& camera : capture.cameras) ours["cameras"].push_back(exactCamera(camera));
  ours["source_from_world"] = rowsToJson(capture.sourceFromWorld);
  if (capture.geo) {
    ours["geo"] = {{"latitude", capture.geo->latitude},
                   {"longitude", capture.geo->longitude},
                   {"altitude", capture.geo->altitude},
                   {"enu_from_world", rowsToJson(capture.geo->enuFromWorld)}};
  }
  if (!capture.observations.empty()) {
    ours["observations"] = "observations.safetensors";
    writeFileAtomically(capture.root / "observations.safetensors", encodeObservations(capture.observations), true);
  }
  json["frames"] = std::move(frames);
  requireUtf8Names(capture.photos);
  writeFileAtomically(capture.root / "transforms.json", json.dump(1) + "\n", true);
}

void requireUtf8Names(const std::vector<Photo>& photos) {
  for (const Photo& photo : photos) {
    const Json name = photo.name;
    try {
      name.dump();
    } catch (const Json::type_error&) {
      throw Error(name.dump(-1, ' ', false, Json::error_handler_t::replace), "", "the photo's name is not UTF-8",
                  "rename it");
    }
  }
}

}  // namespace tessera
