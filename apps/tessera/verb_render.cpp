#include <fmt/format.h>

#include "apps/tessera/render_source.h"
#include "apps/tessera/verbs.h"
#include "base/error.h"
#include "base/progress.h"
#include "eval/evaluate.h"
#include "eval/render_views.h"
#include "import/capture_reader.h"

namespace tessera {
namespace {

struct RenderFlags {
  std::string model, out, views, path, dataparserTransforms, size, split = "test";
  DeviceOptions device;
  int level = 0;
  double memoryMiB = 0;
};

// Throws Error if a rendering would replace a photo or mask of the capture, or what it is a link to.
void requireOtherPictures(const fs::path& out, const Capture& capture) {
  std::error_code status;
  for (const Photo& photo : capture.photos) {
    const fs::path rendering = (out / photo.name).replace_extension(".png");
    for (const fs::path& file : {photo.image, photo.mask})
      if (!file.empty() && fs::equivalent(rendering, file, status))
        throw Error(rendering.string(), "", "is of the capture, and would be replaced by its rendering",
                    "name another folder");
  }
}

}  // namespace

void addRenderVerb(CLI::App& app) {
  auto flags = std::make_shared<RenderFlags>();
  CLI::App* verb =
      app.add_subcommand("render", "images of a model, scene or world: PNGs into a folder, or an .mp4 through ffmpeg");
  verb->footer(
      "Examples:\n  tessera render fox.model frames/ --views fox.capture\n"
      "  tessera render fox.model flight.mp4 --path camera_path.json --size 1280x720");
  verb->add_option("model", flags->model, "model or scene folder, or world.json")->required();
  verb->add_option("out", flags->out, "folder for PNGs, or a file ending in .mp4, for a video")->required();
  CLI::Option* views = verb->add_option("--views", flags->views, "render the views of this capture");
  CLI::Option* path =
      verb->add_option("--path", flags->path, "render along this nerfstudio camera path")->excludes(views);
  verb->add_option("--dataparser-transforms", flags->dataparserTransforms,
                   "dataparser_transforms.json of the nerfstudio run whose viewer wrote the path; default: the one "
                   "beside a path of that viewer, if there is one")
      ->needs(path);
  verb->add_option("--split", flags->split, "which photos' views")
      ->capture_default_str()
      ->needs(views)
      ->check(CLI::IsMember({"test", "validation", "train", "all"}));
  verb->add_option("--size", flags->size, "image size, as 1280x720; default: the camera's own");
  verb->add_option("--lod", flags->level, "scenes only: the finest level of detail to render")
      ->capture_default_str()
      ->check(CLI::Range(0, 64));
  verb->add_option("--memory-mib", flags->memoryMiB,
                   "scenes only: memory for the contents; 0: half of the machine's, or of a GPU's own")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1e9));
  addDeviceFlags(*verb, flags->device);
  verb->callback([flags] {
    if (flags->views.empty() && flags->path.empty()) throw CLI::RequiredError("--views or --path");
    RenderViewsOptions options;
    if (!flags->size.empty()) parsePictureSize(flags->size, options.width, options.height);
    const std::unique_ptr<Device> device = makeDevice(flags->device);
    const RenderSourceOptions sourceOptions{flags->device.threads, flags->level, flags->memoryMiB};
    requireSceneFor(sourceOptions, flags->model);
    const std::unique_ptr<RenderSource> renderSource = openRenderSource(*device, flags->model, sourceOptions);
    std::vector<NamedView> views;
    if (!flags->path.empty()) {
      CameraPath path = readCameraPath(flags->path, flags->dataparserTransforms);
      if (options.width > 0) path.width = options.width, path.height = options.height;
      views = viewsOfPath(path, renderSource->sourceFromWorld());
      options.framesPerSecond = path.framesPerSecond;
    } else {
      const Capture capture = readCapture(flags->views);
      renderSource->requireMatchingWorld(capture);
      views = viewsOfCapture(capture, splitFromName(flags->split));  // all photos, if no split was given
      if (!isVideoName(flags->out)) requireOtherPictures(flags->out, capture);
    }
    Progress progress("rendering", static_cast<int64_t>(views.size()), "frames");
    options.onView = [&progress](size_t done) { progress.update(static_cast<int64_t>(done)); };
    renderViews(renderSource->renderer(), views, flags->out, options);
    progress.finish();
    fmt::print("{}: {} frames\n", flags->out, views.size());
  });
}

}  // namespace tessera
