// Converts decoded transforms.json files into a capture: paths, cameras, splits, points.
#include <fmt/format.h>

#include <algorithm>
#include <unordered_map>

#include "base/error.h"
#include "base/image_io.h"
#include "base/log.h"
#include "base/safetensors.h"
#include "import/clean.h"
#include "import/transforms_json.h"
#include "scene/ply.h"

namespace tessera {
namespace {

bool isFile(const fs::path& path) {
  std::error_code status;
  return fs::is_regular_file(path, status);
}

// Resolves a path as written in the file; Blender omits the extension, Windows uses backslashes. Returns nothing if it
// leaves the folder, and a path that does not exist if there is no such file.
std::optional<fs::path> resolvePhoto(const fs::path& root, std::string written) {
  std::replace(written.begin(), written.end(), '\\', '/');
  const auto path = resolveInside(root, written);
  if (!path || isFile(*path)) return path;
  for (const char* extension : {".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG"}) {
    const auto candidate = resolveInside(root, written + extension);
    if (candidate && isFile(*candidate)) return candidate;
  }
  return path;
}

std::optional<ImageInfo> photoSize(const fs::path& path) {
  if (!isFile(path)) return std::nullopt;
  try {
    return probeImageFile(path);
  } catch (const Error&) {
    return std::nullopt;
  }
}

// Returns the pose in a camera-to-world matrix, with the rounding errors of its rotation corrected, or nothing if it is
// not rigid or its position is out of bounds.
std::optional<Pose> poseFromGl(const Mat4d& worldFromCameraGl) {
  if (!worldFromCameraGl.allFinite() || !isPlace(worldFromCameraGl.topRightCorner<3, 1>())) return std::nullopt;
  Mat3d rotation = flippedYz(worldFromCameraGl.topLeftCorner<3, 3>());
  const double deviation = (rotation.transpose() * rotation - Mat3d::Identity()).norm();
  if (deviation > 0.02 || rotation.determinant() < 0) return std::nullopt;
  if (deviation > 1e-9) {  // rounded by the writer: take the nearest rotation
    const Eigen::JacobiSVD<Mat3d> svd(rotation, Eigen::ComputeFullU | Eigen::ComputeFullV);
    rotation = svd.matrixU() * svd.matrixV().transpose();
  }
  return Pose{rotation, worldFromCameraGl.topRightCorner<3, 1>()};
}

std::optional<Split> splitOfName(const fs::path& file) {
  const std::string name = file.filename().string();
  if (name == "transforms_train.json") return Split::train;
  if (name == "transforms_val.json") return Split::validation;
  if (name == "transforms_test.json") return Split::test;
  return std::nullopt;
}

int findOrAddCamera(const Camera& camera, std::vector<Camera>& cameras) {
  const auto match = std::find(cameras.begin(), cameras.end(), camera);
  const auto index = static_cast<int>(match - cameras.begin());
  if (match == cameras.end()) cameras.push_back(camera);
  return index;
}

void readPoints(const fs::path& file, const TransformsFile& transforms, Capture& capture) {
  if (transforms.pointFile.empty()) return;
  const auto path = resolveInside(file.parent_path(), transforms.pointFile);
  if (!path || !isFile(*path)) {
    warn("{}: ply_file_path {}: is not there; no sparse points", file.string(), transforms.pointFile);
    return;
  }
  capture.points = readPly(*path);
  if (!transforms.isOurs) std::erase_if(capture.points, [](const SparsePoint& p) { return !isPlace(p.xInWorld); });
}

// `photoOfFrame` is the index of each frame's photo, -1 for frames that were dropped.
void readObservations(const fs::path& file, const TransformsFile& transforms, const std::vector<int>& photoOfFrame,
                      Capture& capture) {
  if (transforms.observationFile.empty()) return;
  const auto path = resolveInside(file.parent_path(), transforms.observationFile);
  if (!path) throw Error(file.string(), "tessera.observations", "leaves the folder", "import the photos again");
  const Safetensors tensors = readSafetensors(*path);
  const auto photo = tensors.require(*path, "photo", TensorType::u32).as<uint32_t>();
  const auto point = tensors.require(*path, "point", TensorType::u32).as<uint32_t>();
  const auto pixel = tensors.require(*path, "pixel", TensorType::f32).as<float>();
  const auto error = tensors.require(*path, "error", TensorType::f32).as<float>();
  bool valid = point.size() == photo.size() && pixel.size() == 2 * photo.size() && error.size() == photo.size();
  for (size_t i = 0; valid && i < photo.size(); ++i) {
    valid = photo[i] < photoOfFrame.size() && point[i] < capture.points.size();
    if (valid && photoOfFrame[photo[i]] >= 0) {
      capture.observations.push_back(
          {static_cast<uint32_t>(photoOfFrame[photo[i]]), point[i], pixel[2 * i], pixel[2 * i + 1], error[i]});
    }
  }
  if (!valid) throw Error(path->string(), "", "does not fit transforms.json", "import the photos again");
}

struct Dropped {
  std::vector<std::string> outside, poses, lenses;  // photos dropped
  std::vector<std::string> masks, depths;           // dropped without their photos
  std::string lensReason;
};

void reportDropped(const fs::path& file, const Dropped& dropped) {
  const auto report = [&file](const std::vector<std::string>& names, const std::string& what) {
    if (!names.empty()) warn("{}: {} {} ({})", file.string(), names.size(), what, abbreviateList(names));
  };
  report(dropped.outside, "photos have paths that leave the folder; dropped");
  report(dropped.poses,
         "photos have a pose that is not a number, farther out than 1e12, or not a rotation and a "
         "translation; dropped");
  report(dropped.lenses, "photos have a lens that cannot be used: " + dropped.lensReason + "; dropped");
  report(dropped.masks, "masks have paths that leave the folder: those photos train unmasked");
  report(dropped.depths, "depth maps have paths that leave the folder; ignored");
}

// Reports the keys that are unknown or not supported, in one line for each kind.
void reportKeys(const fs::path& file, const TransformsFile& transforms) {
  constexpr size_t kNamed = 10;
  if (const auto& keys = transforms.unknownKeys; !keys.empty()) {
    std::string names;
    size_t named = 0;
    for (auto key = keys.begin(); key != keys.end() && named < kNamed; ++key, ++named) {
      names += fmt::format("{}{:.60}", named > 0 ? ", " : "", *key);
    }
    if (keys.size() > kNamed) names += fmt::format(" and {} more", keys.size() - kNamed);
    warn("{}: ignored, as unknown to tessera: {}", file.string(), names);
  }
  for (const auto& [key, consequence] : transforms.unmetKeys) {
    warn("{}: {} is not followed: {}", file.string(), key, consequence);
  }
  if (!transforms.isOurs && !transforms.appliedTrouble.empty()) {
    warn("{}: {}; ignored, so depth maps may have the wrong scale, and camera paths made for the source another place",
         file.string(), transforms.appliedTrouble);
  }
}

// Normalises a path: "./images/a.jpg" and "images\\a.jpg" become images/a.jpg.
std::string normalPath(std::string written) {
  std::replace(written.begin(), written.end(), '\\', '/');
  return fs::path(written).lexically_normal().generic_string();
}

// Returns the split of each frame according to the lists of names, nothing where no list contains it. A later list
// takes precedence, so that a photo in a held-out list is held out. A list that matches no frame at all, and so would
// hold out nothing, is reported in `error`.
std::vector<std::optional<Split>> splitsOfFrames(const fs::path& file, const TransformsFile& transforms,
                                                 std::optional<Error>& error) {
  std::vector<std::optional<Split>> splits(transforms.frames.size());
  std::unordered_map<std::string, std::vector<size_t>> framesOfPath;
  for (size_t i = 0; i < splits.size(); ++i) framesOfPath[normalPath(transforms.frames[i].file)].push_back(i);
  for (const SplitList& list : transforms.splitLists) {
    std::vector<std::string> strangers;
    for (const std::string& name : list.names) {
      const auto frames = framesOfPath.find(normalPath(name));
      if (frames == framesOfPath.end()) {
        strangers.push_back(name);
      } else {
        for (const size_t i : frames->second) splits[i] = list.split;
      }
    }
    if (strangers.empty()) continue;
    if (strangers.size() == list.names.size()) {
      error = Error(file.string(), list.key, "names no frame of this file (" + abbreviateList(strangers) + ")",
                    "write its names as in file_path, or choose a new split with --holdout every:8");
    } else {
      warn("{}: {}: {} of {} names are of no frame ({})", file.string(), list.key, strangers.size(), list.names.size(),
           abbreviateList(strangers));
    }
  }
  // Where only held-out frames are listed, the other frames are meant for training.
  const bool listsTraining =
      std::any_of(transforms.splitLists.begin(), transforms.splitLists.end(),
                  [](const SplitList& list) { return list.split == Split::train && !list.names.empty(); });
  std::vector<std::string> unlisted;
  for (size_t i = 0; listsTraining && !error && i < splits.size(); ++i) {
    if (!splits[i]) unlisted.push_back(transforms.frames[i].file);
  }
  if (!unlisted.empty()) {
    warn("{}: {} frames are in no list of a split; they train ({})", file.string(), unlisted.size(),
         abbreviateList(unlisted));
  }
  return splits;
}

// Adds one frame. Returns false if it is dropped.
bool addFrame(const fs::path& root, const TransformsFile& transforms, const TransformsFrame& frame,
              SourceCapture& source, Dropped& dropped) {
  Capture& capture = source.capture;
  Photo photo;
  const auto image = resolvePhoto(root, frame.file);
  if (!image) return dropped.outside.push_back(frame.file), false;
  photo.image = *image;
  const auto pose = poseFromGl(frame.worldFromCameraGl);
  if (!pose) return dropped.poses.push_back(frame.file), false;
  photo.worldFromCamera = *pose;
  if (frame.camera >= 0) {
    photo.camera = frame.camera;
  } else if (const auto info = photoSize(photo.image)) {  // cleanSource reports missing and unreadable photos
    const auto camera = cameraFromIntrinsics(frame.intrinsics, info->width, info->height, dropped.lensReason);
    if (!camera) return dropped.lenses.push_back(frame.file), false;
    photo.camera = findOrAddCamera(*camera, capture.cameras);
  }
  bool inverted = false;
  if (!frame.mask.empty()) {
    if (const auto mask = resolvePhoto(root, frame.mask)) {
      photo.mask = *mask;
    } else {
      dropped.masks.push_back(frame.mask);
    }
  } else if (!transforms.isOurs) {
    const fs::path dynamic = photo.image.parent_path() / ("dynamic_mask_" + photo.image.stem().string() + ".png");
    if (isFile(dynamic)) {
      photo.mask = dynamic;
      inverted = true;
    }
  }
  if (!frame.depth.empty()) {
    if (const auto depth = resolvePhoto(root, frame.depth)) {
      photo.depth = *depth;
    } else {
      dropped.depths.push_back(frame.depth);
    }
    photo.depthUnit = frame.depthUnit > 0                ? frame.depthUnit
                      : transforms.integerDepthScale > 0 ? static_cast<float>(transforms.integerDepthScale)
                                                         : static_cast<float>(0.001 * transforms.appliedScale);
  }
  photo.name =
      !frame.name.empty() ? frame.name : photo.image.lexically_relative(fs::weakly_canonical(root)).generic_string();
  photo.exposure = frame.exposure;
  photo.orientation = frame.orientation;
  photo.gps = frame.gps;
  capture.photos.push_back(std::move(photo));
  source.maskIsInverted.push_back(inverted);
  source.exrUnit.push_back(transforms.isOurs ? 1 : transforms.appliedScale);
  return true;
}

}  // namespace

std::vector<fs::path> findTransforms(const fs::path& source) {
  if (isFile(source) && source.extension() == ".json") return {source};
  if (isFile(source / "transforms.json")) return {source / "transforms.json"};
  std::vector<fs::path> files;
  for (const char* name : {"transforms_train.json", "transforms_val.json", "transforms_test.json"}) {
    if (isFile(source / name)) files.push_back(source / name);
  }
  return files;
}

TransformsFile loadTransforms(const fs::path& file) {
  std::string reason;
  auto transforms = decodeTransforms(readTextFile(file), reason);
  if (!transforms) throw Error(file.string(), "", reason, "correct the file, or export it again");
  return std::move(*transforms);
}

bool holdsPosesOfOthers(const fs::path& folder) {
  const fs::path file = folder / "transforms.json";
  if (!isFile(file)) return false;
  std::string reason;
  const auto transforms = decodeTransforms(readTextFile(file), reason);
  return transforms && !transforms->isOurs;
}

SourceCapture readTransforms(const std::vector<fs::path>& files) {
  SourceCapture source;
  source.knowsUp = true;
  Capture& capture = source.capture;
  for (const fs::path& given : files) {
    const fs::path file = fs::absolute(given);  // its folder has a name
    const TransformsFile transforms = loadTransforms(given);
    reportKeys(given, transforms);
    source.knowsUp &= !transforms.isOfColmap;
    if (transforms.isOurs) {
      source.isOurs = true;
      capture.cameras = transforms.cameras;
      capture.geo = transforms.geo;
      capture.sourceFromWorld = transforms.sourceFromWorld;
    } else {
      Mat4d worldFromSource = transforms.appliedTransform;
      worldFromSource.topRows<3>() *= transforms.appliedScale;
      capture.sourceFromWorld = affineInverse(worldFromSource);
    }
    readPoints(file, transforms, capture);
    std::vector<std::optional<Split>> splits;
    if (const auto split = files.size() > 1 ? splitOfName(file) : std::nullopt) {  // a single file is a whole capture
      splits.assign(transforms.frames.size(), split);
      source.hasOwnSplit = true;
    } else {
      splits = splitsOfFrames(file, transforms, source.splitError);
      for (const SplitList& list : transforms.splitLists) source.hasOwnSplit |= !list.names.empty();
    }
    Dropped dropped;
    std::vector<int> photoOfFrame;
    for (size_t i = 0; i < transforms.frames.size(); ++i) {
      const bool isAdded = addFrame(file.parent_path(), transforms, transforms.frames[i], source, dropped);
      photoOfFrame.push_back(isAdded ? static_cast<int>(capture.photos.size()) - 1 : -1);
      if (isAdded) capture.photos.back().split = splits[i].value_or(Split::train);
    }
    reportDropped(given, dropped);
    readObservations(file, transforms, photoOfFrame, capture);
  }
  return source;
}

}  // namespace tessera
