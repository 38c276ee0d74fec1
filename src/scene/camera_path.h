// The camera path of nerfstudio's viewer (camera_path.json): what a video follows.
// Source: nerfstudio, cameras/camera_paths.py and the viewer's export; the field of view is vertical, pixels are
// square.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "scene/camera.h"

namespace tessera {

struct CameraPathView {
  // In the world that the file speaks of, camera axes already ours. That is the capture's source world: apply the inverse
  // of Capture::sourceFromWorld before rendering.
  Pose worldFromCamera;
  double verticalFieldOfView = 50;  // degrees
};

struct CameraPath {
  int width = 1920, height = 1080;  // of every frame, pixels
  double framesPerSecond = 24;
  double seconds = 0;    // as the file says; the frames are `views`, one each
  bool fisheye = false;  // equidistant instead of perspective
  std::vector<CameraPathView> views;

  // The lens of one frame: pinhole, or an OpenCV fisheye without distortion, centred.
  Camera cameraOf(const CameraPathView& view) const;
};

// Nothing when the text is not JSON of this form, a number is not finite or out of bounds (sides of 1 to 16384 pixels,
// fields of view between 0 and 180 degrees), a matrix is no rotation, there are no frames, or the camera type is one
// that has no lens model (equirectangular). Unknown keys are ignored; absent size, rate and duration are nerfstudio's
// defaults.
std::optional<CameraPath> decodeCameraPath(std::string_view text);
CameraPath readCameraPath(const fs::path& path);  // throws Error naming the path

std::string encodeCameraPath(const CameraPath& path);
void writeCameraPath(const fs::path& file, const CameraPath& path);

}  // namespace tessera
