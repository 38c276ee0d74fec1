// Pictures for people: a model seen from the views of a capture or along a camera path, as PNGs or as a video.
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
  std::string name;  // the photo's, or the number of the frame
  Camera camera;
  Pose worldFromCamera;
};

// The views of the photos in exactly this split, or of all photos. Throws Error when there are none.
std::vector<NamedView> viewsOfCapture(const Capture& capture, std::optional<Split> split);

// The views along a path, brought into the world of the capture (or model) whose sourceFromWorld is given.
std::vector<NamedView> viewsOfPath(const CameraPath& path, const Mat4d& sourceFromWorld);

struct RenderViewsOptions {
  int width = 0, height = 0;    // of every picture, pixels; 0: the camera's own
  double framesPerSecond = 24;  // of a video
  std::function<void(size_t done)> onView;
};

// Each view over the renderer's background. `out` is a folder of PNGs, at the photos' own relative paths, or a video
// where it ends in .mp4: then every frame has the size of the first. Throws Error when it cannot be written.
void renderViews(ViewRenderer& renderer, const std::vector<NamedView>& views, const fs::path& out,
                 const RenderViewsOptions& options);

}  // namespace tessera
