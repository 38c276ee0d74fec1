#include "eval/render_views.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cctype>
#include <cmath>

#include "base/check.h"
#include "base/error.h"
#include "base/image_io.h"
#include "eval/evaluate.h"
#include "eval/picture_files.h"
#include "eval/video.h"

namespace tessera {
namespace {

// `width`, `height`: of the image; 0: those of the camera.
void requireRenderable(const ViewRenderer& renderer, const NamedView& view, int width, int height) {
  const Camera& camera = view.camera;
  if (const std::string reason = renderer.whyNotThrough(camera); !reason.empty())
    throw Error(view.name, "", reason, "render along a path of perspective, or views of undistorted photos");
  if (width == 0) return;
  // One side may be rounded to whole pixels.
  const double ratio = double{1} * camera.width / camera.height;
  if (std::abs(height * ratio - width) <= 1 || std::abs(width / ratio - height) <= 1) return;
  throw Error(
      view.name, "",
      fmt::format("is {}x{} pixels large, and would be stretched to {}x{}", camera.width, camera.height, width, height),
      "give a --size of its shape, or render to a folder, without a --size");
}

}  // namespace

std::vector<NamedView> viewsOfCapture(const Capture& capture, std::optional<Split> split) {
  std::vector<NamedView> views;
  for (const Photo& photo : capture.photos) {
    if (split && photo.split != *split) continue;
    views.push_back({photo.name, capture.cameras[static_cast<size_t>(photo.camera)], photo.worldFromCamera});
  }
  if (views.empty()) {
    throw Error(capture.root.string(), "",
                fmt::format("no photo is in the split \"{}\"", split ? splitName(*split) : "all"),
                "import with --holdout every:8, or choose another --split");
  }
  return views;
}

std::vector<NamedView> viewsOfPath(const CameraPath& path, const Mat4d& sourceFromWorld) {
  const Mat4d worldFromPath = (path.pathFromSource * sourceFromWorld).inverse();
  const double scale = std::cbrt(worldFromPath.topLeftCorner<3, 3>().determinant());
  std::vector<NamedView> views;
  for (const CameraPathView& view : path.views) {
    Pose pose;
    pose.translation = (worldFromPath * view.worldFromCamera.translation.homogeneous()).head<3>();
    pose.rotation =
        Eigen::Quaterniond(Mat3d(worldFromPath.topLeftCorner<3, 3>() * view.worldFromCamera.rotation / scale))
            .normalized();
    views.push_back({fmt::format("{:05}", views.size()), path.makeViewCamera(view), pose});
  }
  return views;
}

bool isVideoName(const fs::path& out) {
  std::string extension = out.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  for (const char* other : {".avi", ".mkv", ".mov", ".webm"})
    if (extension == other)
      throw Error(out.string(), "", "is no name of a video that is written", "let it end in .mp4");
  return extension == ".mp4";
}

void renderViews(ViewRenderer& renderer, const std::vector<NamedView>& views, const fs::path& out,
                 const RenderViewsOptions& options) {
  CHECK(!views.empty());
  CHECK((options.width > 0) == (options.height > 0));
  const bool isVideo = isVideoName(out);
  int width = options.width, height = options.height;
  if (isVideo && width == 0) width = views[0].camera.width, height = views[0].camera.height;
  for (const NamedView& view : views) requireRenderable(renderer, view, width, height);
  std::optional<VideoWriter> video;
  if (isVideo) {
    VideoOptions videoOptions;
    videoOptions.width = width;
    videoOptions.height = height;
    videoOptions.framesPerSecond = options.framesPerSecond;
    video.emplace(out, videoOptions);
  }
  PictureFiles files(out);
  size_t done = 0;
  for (const NamedView& view : views) {
    const Camera camera = width > 0 ? view.camera.scaledTo(width, height) : view.camera;
    const ImageU8 picture =
        toBytes(compositeOver(renderer.render(camera, view.worldFromCamera), renderer.background()));
    if (video) {
      video->add(picture);
    } else {
      writePng(files.at(files.uniqueStem(view.name), ".png"), picture);
    }
    if (options.onView) options.onView(++done);
  }
  if (video) video->finish();
}

}  // namespace tessera
