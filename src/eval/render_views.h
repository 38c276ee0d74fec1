// Renders a model from the views of a capture or along a camera path, as PNGs or as a video.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/file.h"
#include "scene/camera_path.h"
#include "scene/capture.h"
#include "scene/view_renderer.h"

namespace tessera {

struct NamedView {
  std::string name;  // of the photo, or the number of the frame
  Camera camera;
  Pose worldFromCamera;
};

// Returns the views of the photos in this split, or of all photos without one. Throws Error if there are none.
std::vector<NamedView> viewsOfCapture(const Capture& capture, std::optional<Split> split);

// Returns the views along a path, transformed into the world of the capture (or model) that has this sourceFromWorld.
std::vector<NamedView> viewsOfPath(const CameraPath& path, const Mat4d& sourceFromWorld);

struct RenderViewsOptions {
  int width = 0, height = 0;                // of every image, pixels; 0: those of the camera
  double framesPerSecond = 24;              // of a video
  std::function<void(size_t done)> onView;  // called after each view with the number of views done
};

// Returns whether `out` names a video (.mp4). Throws Error if it names one of another format, which is not written.
bool isVideoName(const fs::path& out);

// Renders each view over the renderer's background. `out` is a folder of PNGs, at the relative paths of the photos, or
// a video (isVideoName), whose frames all have the size of the first view. Throws Error if it cannot be written, or,
// before the first view is rendered, if the renderer cannot draw through the camera of one, or the size would stretch
// it.
void renderViews(ViewRenderer& renderer, const std::vector<NamedView>& views, const fs::path& out,
                 const RenderViewsOptions& options);

}  // namespace tessera
