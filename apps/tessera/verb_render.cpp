#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "base/image_io.h"
#include "base/progress.h"
#include "eval/video.h"
#include "import/capture_reader.h"
#include "representations/field/field_renderer.h"
#include "scene/camera_path.h"
#include "train/model_folder.h"

namespace tessera {
namespace {

struct View {
  std::string name;
  Camera camera;
  Pose worldFromCamera;
};

struct RenderFlags {
  std::string model, out, views, path, size, split = "test";
  DeviceOptions device;
};

std::vector<View> viewsOfCapture(const RenderFlags& flags) {
  const Capture capture = readCapture(flags.views);
  std::vector<View> views;
  for (const Photo& photo : capture.photos) {
    const bool wanted = flags.split == "all" || (photo.split == Split::test) == (flags.split == "test");
    if (!wanted) continue;
    views.push_back({fs::path(photo.name).stem().string(), capture.cameras[photo.camera], photo.worldFromCamera});
  }
  if (views.empty()) throw Error(flags.views, "", "has no photos in split '" + flags.split + "'", "pass --split all");
  return views;
}

std::vector<View> viewsOfPath(const CameraPath& path, const Mat4d& sourceFromWorld) {
  const Mat4d worldFromSource = sourceFromWorld.inverse();
  const double scale = std::cbrt(worldFromSource.topLeftCorner<3, 3>().determinant());
  std::vector<View> views;
  for (const CameraPathView& view : path.views) {
    Pose pose = view.worldFromCamera;
    pose.translation = (worldFromSource * pose.translation.homogeneous()).head<3>();
    pose.rotation =
        Eigen::Quaterniond(Mat3d(worldFromSource.topLeftCorner<3, 3>() * pose.rotation / scale)).normalized();
    views.push_back({fmt::format("{:05}", views.size()), path.cameraOf(view), pose});
  }
  return views;
}

void resize(const std::string& size, std::vector<View>& views) {
  if (size.empty()) return;
  int width = 0, height = 0, used = 0;
  if (std::sscanf(size.c_str(), "%dx%d%n", &width, &height, &used) != 2 || used != static_cast<int>(size.size()) ||
      width < 1 || height < 1 || width > 16384 || height > 16384) {
    throw CLI::ValidationError("--size", "'" + size + "' is not of the form 1280x720");
  }
  for (View& view : views) view.camera = view.camera.scaledTo(width, height);
}

// Over the renderer's background, as bytes.
ImageU8 finished(const RenderedView& view, const Eigen::Array3f& background) {
  ImageF picture = view.colour;
  for (size_t i = 0; i < view.opacity.pixels.size(); ++i) {
    for (int k = 0; k < 3; ++k) picture.pixels[3 * i + k] += (1 - view.opacity.pixels[i]) * background[k];
  }
  return toBytes(picture);
}

}  // namespace

void addRenderVerb(CLI::App& app) {
  auto flags = std::make_shared<RenderFlags>();
  CLI::App* verb = app.add_subcommand("render", "pictures of a model: PNGs into a folder, or an .mp4 through ffmpeg");
  verb->footer(
      "Examples:\n  tessera render fox.model frames/ --views fox.capture\n"
      "  tessera render fox.model flight.mp4 --path camera_path.json --size 1280x720");
  verb->add_option("model", flags->model, "model folder")->required();
  verb->add_option("out", flags->out, "folder for PNGs, or a file ending in .mp4")->required();
  CLI::Option* views = verb->add_option("--views", flags->views, "draw the views of this capture");
  verb->add_option("--path", flags->path, "draw along this nerfstudio camera path")->excludes(views);
  verb->add_option("--split", flags->split, "which photos' views")
      ->capture_default_str()
      ->check(CLI::IsMember({"test", "train", "all"}));
  verb->add_option("--size", flags->size, "picture size, as 1280x720; default: the camera's own");
  addDeviceFlags(*verb, flags->device);
  verb->callback([flags] {
    if (flags->views.empty() && flags->path.empty()) throw CLI::RequiredError("--views or --path");
    VideoOptions video;
    std::vector<View> views;
    if (!flags->path.empty()) {
      const CameraPath path = readCameraPath(flags->path);
      views = viewsOfPath(path, ModelFolder(flags->model).readPlacement().sourceFromWorld);
      video.framesPerSecond = path.framesPerSecond;
    } else {
      views = viewsOfCapture(*flags);
    }
    resize(flags->size, views);
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const std::unique_ptr<FieldModel> model = loadFieldModel(*device, flags->model);
    FieldRenderer renderer(*model);
    std::optional<VideoWriter> writer;
    if (fs::path(flags->out).extension() == ".mp4") {
      video.width = views[0].camera.width;
      video.height = views[0].camera.height;
      writer.emplace(flags->out, video);
    }
    Progress progress("rendering", static_cast<int64_t>(views.size()), "frames");
    int64_t done = 0;
    for (const View& view : views) {
      Camera camera = view.camera;
      if (writer) camera = camera.scaledTo(video.width, video.height);
      const ImageU8 picture = finished(renderer.render(camera, view.worldFromCamera, nullptr), renderer.background());
      if (writer) {
        writer->add(picture);
      } else {
        writePng(fs::path(flags->out) / (view.name + ".png"), picture);
      }
      progress.update(++done);
    }
    if (writer) writer->finish();
    progress.finish();
    fmt::print("{}: {} frames\n", flags->out, views.size());
  });
}

}  // namespace tessera
