#include "import/colmap_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "base/error.h"
#include "base/log.h"

namespace tessera {
namespace {

// COLMAP's numbers of two models that are special cases of another one, and of one without a focal length.
constexpr int kSimpleFisheye = 14, kFisheye = 15, kEquirectangular = 17;
constexpr uint64_t kMaxSide = 1 << 20;

std::optional<Camera> checkedCamera(LensModel lens, uint64_t width, uint64_t height, std::span<const double> parameters,
                                    std::string& reason) {
  Camera camera;
  if (width == 0 || height == 0 || width > kMaxSide || height > kMaxSide) {
    reason = fmt::format("an image of {} x {} pixels cannot be", width, height);
    return std::nullopt;
  }
  if (parameters.size() != static_cast<size_t>(lensParameterCount(lens))) {
    reason = fmt::format("{} takes {} parameters, not {}", lensName(lens), lensParameterCount(lens), parameters.size());
    return std::nullopt;
  }
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  camera.lens = lens;
  std::copy(parameters.begin(), parameters.end(), camera.parameters.begin());
  const bool sane = std::all_of(parameters.begin(), parameters.end(), [](double p) { return std::abs(p) < kFarthest; });
  if (!sane || !(camera.focalX() > 0) || !(camera.focalY() > 0)) {
    reason = "its parameters are not finite or absurd, or its focal length is not positive";
    return std::nullopt;
  }
  if (lens == LensModel::eucm && !(parameters[4] >= 0 && parameters[4] <= 1 && parameters[5] > 0)) {
    reason = "EUCM requires alpha from 0 to 1 and beta above 0";
    return std::nullopt;
  }
  return camera;
}

std::optional<Pose> decodePose(const ColmapModel::Image& image) {
  const auto& q = image.quaternion;
  const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const Vec3d t(image.translation[0], image.translation[1], image.translation[2]);
  if (!std::isfinite(norm) || norm < 1e-6 || !isPlace(t)) return std::nullopt;
  const Eigen::Quaterniond rotation(q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm);
  return Pose{rotation.toRotationMatrix(), t}.inverse();
}

bool isModelFolder(const fs::path& folder) {
  std::error_code status;
  for (const char* extension : {".bin", ".txt"}) {
    if (fs::is_regular_file(folder / (std::string("cameras") + extension), status) &&
        fs::is_regular_file(folder / (std::string("images") + extension), status)) {
      return true;
    }
  }
  return false;
}

fs::path findImages(const fs::path& source, const fs::path& model) {
  std::error_code status;
  for (const fs::path& candidate :
       {source / "images", model.parent_path() / "images", model.parent_path().parent_path() / "images"}) {
    if (fs::is_directory(candidate, status)) return candidate;
  }
  return source;
}

}  // namespace

std::array<std::string, 3> maskNames(const std::string& name) {
  return {name + ".png", name, fs::path(name).replace_extension(".png").generic_string()};
}

fs::path findMask(const fs::path& maskFolder, const std::string& name) {
  std::error_code status;
  if (!fs::is_directory(maskFolder, status)) return {};
  for (const std::string& candidate : maskNames(name)) {
    const auto path = resolveInside(maskFolder, candidate);
    if (path && fs::is_regular_file(*path, status)) return *path;
  }
  return {};
}

int colmapParameterCount(int model) {
  if (model == kSimpleFisheye) return 3;
  if (model == kFisheye) return 4;
  if (model == kEquirectangular) return 2;
  const auto lens = lensFromNumber(model);
  return lens ? lensParameterCount(*lens) : -1;
}

std::string_view colmapUnusableLens(int model) {
  return model == kEquirectangular ? "EQUIRECTANGULAR" : "";
}

bool isColmapLens(std::string_view model) {
  return model == "SIMPLE_FISHEYE" || model == "FISHEYE" || lensFromName(model);
}

std::optional<Camera> colmapCamera(int model, uint64_t width, uint64_t height, std::span<const double> parameters,
                                   std::string& reason) {
  if (model == kSimpleFisheye || model == kFisheye) {
    if (parameters.size() != static_cast<size_t>(colmapParameterCount(model))) {
      reason = "has the wrong number of parameters";
      return std::nullopt;
    }
    std::array<double, 8> full{};
    full[0] = parameters[0];
    std::copy(parameters.end() - 3, parameters.end(), full.begin() + 1);
    return checkedCamera(LensModel::openCvFisheye, width, height, full, reason);
  }
  const auto lens = lensFromNumber(model);
  if (!lens) {
    reason = fmt::format("lens model number {} is not known", model);
    return std::nullopt;
  }
  return checkedCamera(*lens, width, height, parameters, reason);
}

std::optional<Camera> colmapCamera(std::string_view model, uint64_t width, uint64_t height,
                                   std::span<const double> parameters, std::string& reason) {
  if (model == "SIMPLE_FISHEYE") return colmapCamera(kSimpleFisheye, width, height, parameters, reason);
  if (model == "FISHEYE") return colmapCamera(kFisheye, width, height, parameters, reason);
  const auto lens = lensFromName(model);
  if (!lens) {
    reason = fmt::format("lens model '{}' is not known", model);
    return std::nullopt;
  }
  return checkedCamera(*lens, width, height, parameters, reason);
}

SourceCapture captureFromColmap(const ColmapModel& model, const fs::path& imageFolder, const fs::path& maskFolder) {
  SourceCapture source;
  Capture& capture = source.capture;
  std::unordered_map<uint32_t, int> cameraIndex;
  std::vector<uint32_t> cameraIds;
  for (const auto& [id, camera] : model.cameras) cameraIds.push_back(id);
  std::sort(cameraIds.begin(), cameraIds.end());
  for (const uint32_t id : cameraIds) {
    cameraIndex[id] = static_cast<int>(capture.cameras.size());
    capture.cameras.push_back(model.cameras.at(id));
  }
  std::unordered_map<uint64_t, uint32_t> pointIndex;
  for (const ColmapModel::Point& point : model.points) {
    if (!isPlace(point.point.xInWorld)) continue;
    if (pointIndex.emplace(point.id, static_cast<uint32_t>(capture.points.size())).second) {
      capture.points.push_back(point.point);
    }
  }

  size_t withoutCamera = 0, outside = 0, withoutPose = 0;
  std::map<std::string, size_t> unusable;  // number of photos by lens
  for (const ColmapModel::Image& image : model.images) {
    if (const auto lens = model.unusable.find(image.camera); lens != model.unusable.end()) {
      ++unusable[lens->second];
      continue;
    }
    const auto camera = cameraIndex.find(image.camera);
    const auto path = resolveInside(imageFolder, image.name);
    const auto worldFromCamera = decodePose(image);
    withoutCamera += camera == cameraIndex.end();
    outside += !path;
    withoutPose += !worldFromCamera;
    if (camera == cameraIndex.end() || !path || !worldFromCamera) continue;
    Photo photo;
    photo.name = path->lexically_relative(fs::weakly_canonical(imageFolder)).generic_string();
    photo.camera = camera->second;
    photo.worldFromCamera = *worldFromCamera;
    photo.image = *path;
    photo.mask = findMask(maskFolder, image.name);
    const auto photoIndex = static_cast<uint32_t>(capture.photos.size());
    const Pose cameraFromWorld = worldFromCamera->inverse();
    const Camera& lens = capture.cameras[static_cast<size_t>(photo.camera)];
    for (const ColmapModel::Keypoint& keypoint : image.keypoints) {
      const auto point = pointIndex.find(keypoint.point);
      if (point == pointIndex.end() || !(std::abs(keypoint.x) < 1e7) || !(std::abs(keypoint.y) < 1e7)) continue;
      const auto pixel = lens.pixelFromCamera(cameraFromWorld * capture.points[point->second].xInWorld);
      if (!pixel) continue;
      const double error = (*pixel - Vec2d(keypoint.x, keypoint.y)).norm();
      if (!(error < 1e7)) continue;
      capture.observations.push_back({photoIndex, point->second, static_cast<float>(keypoint.x),
                                      static_cast<float>(keypoint.y), static_cast<float>(error)});
    }
    capture.photos.push_back(std::move(photo));
  }
  source.maskIsInverted.assign(capture.photos.size(), false);
  if (withoutCamera > 0) warn("{} photos name a camera that the model lacks; dropped", withoutCamera);
  if (outside > 0) warn("{} photos have paths that leave {}; dropped", outside, imageFolder.string());
  if (withoutPose > 0) warn("{} photos have a pose that is not a number or absurdly far away; dropped", withoutPose);
  for (const auto& [lens, photos] : unusable)
    warn("{} photos were taken with the lens {}, which cannot be used; dropped", photos, lens);
  return source;
}

namespace {

// Returns the number of photos of a model; 0 if it cannot be read.
uint64_t countPhotos(const fs::path& model) {
  std::error_code status;
  try {
    if (fs::is_regular_file(model / "images.bin", status)) {
      uint64_t count = 0;
      const Bytes head = readFileStart(model / "images.bin", sizeof count);
      if (head.size() == sizeof count) std::memcpy(&count, head.data(), sizeof count);
      return count;
    }
    // Two lines for each photo, and comments.
    const std::string text = readTextFile(model / "images.txt");
    uint64_t lines = 0;
    for (size_t begin = 0; begin < text.size(); begin = std::min(text.find('\n', begin), text.size() - 1) + 1)
      lines += text[begin] == '#' ? 0 : 1;
    return lines / 2;
  } catch (const Error&) {
    return 0;
  }
}

struct ChosenModel {
  std::optional<fs::path> folder;
  fs::path among;  // the folder of several models
  int pieces = 0;  // that are there
};

ChosenModel findModel(const fs::path& source) {
  for (const fs::path& folder : {source / "sparse", source / "colmap" / "sparse"}) {
    // COLMAP numbers the components that it could not join. The one with the most photos is used.
    ChosenModel chosen{.among = folder};
    uint64_t largest = 0;
    for (; isModelFolder(folder / std::to_string(chosen.pieces)); ++chosen.pieces) {
      const fs::path piece = folder / std::to_string(chosen.pieces);
      const uint64_t photos = countPhotos(piece);
      if (chosen.folder && photos <= largest) continue;
      largest = photos;
      chosen.folder = piece;
    }
    if (chosen.folder) return chosen;
    if (isModelFolder(folder)) return {.folder = folder};
  }
  if (isModelFolder(source)) return {.folder = source};
  return {};
}

}  // namespace

std::optional<fs::path> findColmapModel(const fs::path& source) {
  return findModel(source).folder;
}

ColmapModel readColmapModel(const fs::path& folder) {
  std::error_code status;
  const bool binary = fs::is_regular_file(folder / "cameras.bin", status);
  const fs::path pointFile = folder / (binary ? "points3D.bin" : "points3D.txt");
  const bool hasPoints = fs::is_regular_file(pointFile, status);
  if (!hasPoints) warn("{} is missing: no sparse points", pointFile.string());
  std::string reason;
  std::optional<ColmapModel> model;
  if (binary) {
    const Bytes cameras = readFile(folder / "cameras.bin"), images = readFile(folder / "images.bin");
    model = decodeColmapBinary(cameras, images, hasPoints ? readFile(pointFile) : Bytes{}, reason);
  } else {
    const std::string cameras = readTextFile(folder / "cameras.txt"), images = readTextFile(folder / "images.txt");
    model = decodeColmapText(cameras, images, hasPoints ? readTextFile(pointFile) : std::string{}, reason);
  }
  if (!model) throw Error(folder.string(), "", reason, "write the model again with colmap model_converter");
  return *std::move(model);
}

SourceCapture readColmap(const fs::path& given) {
  const fs::path source = fs::weakly_canonical(given);  // its parents have names
  const ChosenModel chosen = findModel(source);
  const fs::path folder = chosen.folder.value_or(source);
  if (chosen.pieces > 1) {
    warn("{} holds {} separate models; the one with the most photos, {}, is taken", chosen.among.string(),
         chosen.pieces, folder.string());
  }
  const fs::path images = findImages(source, folder);
  return captureFromColmap(readColmapModel(folder), images,
                           (images == source ? source : images.parent_path()) / "masks");
}

}  // namespace tessera
