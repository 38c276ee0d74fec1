// The camera path of nerfstudio's viewer (camera_path.json), from which videos are rendered.
// Source: nerfstudio, cameras/camera_paths.py and the viewer's export; the field of view is vertical, pixels are
// square.
//
// The viewer exports poses in the world that nerfstudio trained in, which its dataparser obtained by rotating,
// translating and scaling the source's world. A training run stores that transform in dataparser_transforms.json.
// Source: nerfstudio, data/dataparsers/base_dataparser.py.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "scene/camera.h"

namespace tessera {

// Why a text is refused: a line and column, or a key, and what is wrong there.
struct TextFlaw {
  std::string place, reason;
};

struct CameraPathView {
  Pose worldFromCamera;             // in the world of the file, with camera axes converted to those of scene/axes.h
  double verticalFieldOfView = 50;  // degrees
};

struct CameraPath {
  int width = 1920, height = 1080;  // of every frame, pixels
  double framesPerSecond = 24;
  double seconds = 0;                 // duration that the file states
  bool fisheye = false;               // equidistant instead of perspective
  std::vector<CameraPathView> views;  // one per frame
  bool fromViewer = false;  // has the viewer's key frames: the poses are in nerfstudio's world, not in the source's
  // Similarity from the capture's source world (Capture::sourceFromWorld) to that of `views`. Not part of the file.
  Mat4d pathFromSource = Mat4d::Identity();

  // Returns the camera of one frame: a pinhole, or an OpenCV fisheye without distortion, with a centred principal
  // point.
  Camera makeViewCamera(const CameraPathView& view) const;
};

// Decodes the text of a camera_path.json. Returns nothing if it is not JSON of this form, a number is not finite or out
// of bounds (sides of 1 to 16384 pixels, fields of view between 0 and 180 degrees), a matrix is not a rotation, there
// are no frames, or the camera type has no lens model here (equirectangular). Unknown keys are ignored; a missing size,
// frame rate or duration takes nerfstudio's default.
// `flaw`: optional; where and why the text was refused.
std::optional<CameraPath> decodeCameraPath(std::string_view text, TextFlaw* flaw = nullptr);

// Decodes the text of a dataparser_transforms.json, {"transform": 3×4, "scale": s}. Returns the similarity
// x ↦ s · (transform · x) from the world of the source, before what transforms.json calls applied_transform, to the
// world that nerfstudio trained in. Returns nothing if the text is not JSON of this form, a number is not finite or out
// of bounds, or the matrix is not a rotation.
std::optional<Mat4d> decodeDataparserTransforms(std::string_view text);
Mat4d readDataparserTransforms(const fs::path& path);  // throws Error naming the path

// Reads a camera path, with `pathFromSource` from the named dataparser_transforms.json or, where none is named, from
// the one in the folder of `path`, if nerfstudio's viewer wrote the path and the file exists; warns if it does not
// exist. Throws Error naming the file, and the place in it, that cannot be read or decoded.
CameraPath readCameraPath(const fs::path& path, const fs::path& dataparserTransforms = {});

std::string encodeCameraPath(const CameraPath& path);
void writeCameraPath(const fs::path& file, const CameraPath& path);

}  // namespace tessera
