// The camera path of nerfstudio's viewer (camera_path.json): what a video follows.
// Source: nerfstudio, cameras/camera_paths.py and the viewer's export; the field of view is vertical, pixels are
// square.
//
// The viewer exports poses in the world that nerfstudio trained in: its dataparser turned, moved and scaled the
// source's. A training run leaves what it did in dataparser_transforms.json. Source: nerfstudio,
// data/dataparsers/base_dataparser.py.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "scene/camera.h"

namespace tessera {

struct CameraPathView {
  Pose worldFromCamera;             // in the world that the file speaks of, camera axes already ours
  double verticalFieldOfView = 50;  // degrees
};

struct CameraPath {
  int width = 1920, height = 1080;  // of every frame, pixels
  double framesPerSecond = 24;
  double seconds = 0;    // as the file says; the frames are `views`, one each
  bool fisheye = false;  // equidistant instead of perspective
  std::vector<CameraPathView> views;
  bool fromViewer = false;  // has the viewer's key frames: the poses are in nerfstudio's world, not in the source's
  // Similarity from the capture's source world (Capture::sourceFromWorld) to that of `views`. Not part of the file.
  Mat4d pathFromSource = Mat4d::Identity();

  // The lens of one frame: pinhole, or an OpenCV fisheye without distortion, centred.
  Camera cameraOf(const CameraPathView& view) const;
};

// Nothing when the text is not JSON of this form, a number is not finite or out of bounds (sides of 1 to 16384 pixels,
// fields of view between 0 and 180 degrees), a matrix is no rotation, there are no frames, or the camera type is one
// that has no lens model (equirectangular). Unknown keys are ignored; absent size, rate and duration are nerfstudio's
// defaults.
std::optional<CameraPath> decodeCameraPath(std::string_view text);

// Text of a dataparser_transforms.json: {"transform": 3×4, "scale": s}. The similarity x ↦ s · (transform · x) from the
// world of the source, before what transforms.json calls applied_transform, to the one that nerfstudio trained in.
// Nothing when the text is not JSON of this form, a number is not finite or out of bounds, or the matrix is no
// rotation.
std::optional<Mat4d> decodeDataparserTransforms(std::string_view text);
Mat4d readDataparserTransforms(const fs::path& path);  // throws Error naming the path

// With `pathFromSource` of the named dataparser_transforms.json, or else of the one beside `path`, where there is one;
// warns when the path comes from the viewer and there is none. Throws Error naming the file that is wrong.
CameraPath readCameraPath(const fs::path& path, const fs::path& dataparserTransforms = {});

std::string encodeCameraPath(const CameraPath& path);
void writeCameraPath(const fs::path& file, const CameraPath& path);

}  // namespace tessera
