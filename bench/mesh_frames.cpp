// mesh_frames SCENE CAPTURE [WIDTHxHEIGHT]: the images of a mesh scene on a GPU against those on the CPU. For the views
// of the held-out photos: exact images, single dithered frames, the mean of 64. For a flight through these views: each
// frame with and without blending. Views are pinholes without the photos' distortion, except for exact images, which
// are also drawn through the photos' lens. Prints JSON. ONLY=decoders, views or flight measures only that. See mesh.sh.
#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string_view>

#include "base/error.h"
#include "eval/psnr.h"
#include "gpu/context.h"
#include "import/capture_reader.h"
#include "render/cpu/scene_renderer.h"
#include "render/tile_scene.h"
#include "render/vulkan/gpu_scene_renderer.h"
#include "representations/mesh/content/mesh_payload.h"
#include "representations/mesh/cpu/mesh_drawer.h"
#include "representations/mesh/vulkan/gpu_mesh_drawer.h"

namespace tessera {
namespace {

constexpr int kFramesOfMean = 64, kFramesOfView = 24, kFramesAtRest = 8, kFramesOfSmooth = 6;
constexpr double kMetresOfFrame = 0.5;  // 15 m/s with 30 frames per second
constexpr uint64_t kBudgetBytes = uint64_t{4} << 30;

struct View {
  Camera lens, pinhole;
  Pose worldFromCamera;
};

std::vector<View> heldOutViews(const Capture& capture, int width, int height) {
  std::vector<View> views;
  for (const int number : capture.photosIn(Split::test)) {
    const Photo& photo = capture.photos[number];
    View view;
    view.lens = capture.cameras[photo.camera];
    if (width > 0) view.lens = view.lens.scaledTo(width, height);
    view.pinhole.width = view.lens.width;
    view.pinhole.height = view.lens.height;
    view.pinhole.lens = LensModel::pinhole;
    view.pinhole.parameters = {view.lens.focalX(), view.lens.focalY(), view.lens.centreX(), view.lens.centreY()};
    view.worldFromCamera = photo.worldFromCamera;
    views.push_back(view);
  }
  return views;
}

class Renderers {
 public:
  explicit Renderers(const fs::path& scene) : scene_(scene), context_(GpuContext::open()) {
    TileScene opened = open();
    SceneRendererSettings settings;
    settings.budgetBytes = kBudgetBytes;
    oracle_ = std::make_unique<SceneRenderer>(makeMeshDrawer(), opened.frame, std::move(opened.tree),
                                              std::move(opened.source), settings);
  }

  ImageF expected(const Camera& camera, const Pose& pose) { return oracle_->render(camera, pose, nullptr).colour; }
  // The mean of 16 samples of each pixel.
  ImageF smooth(const Camera& camera, const Pose& pose) {
    constexpr int kEdge = 4;
    const ImageF fine = expected(camera.scaledTo(kEdge * camera.width, kEdge * camera.height), pose);
    ImageF mean(camera.width, camera.height, 3);
    for (int y = 0; y < fine.height; ++y)
      for (int x = 0; x < fine.width; ++x)
        for (int c = 0; c < 3; ++c) mean.at(x / kEdge, y / kEdge)[c] += fine.at(x, y)[c] / (kEdge * kEdge);
    return mean;
  }
  std::unique_ptr<GpuSceneRenderer> onGpu(const GpuMeshSettings& settings) {
    GpuRendererSettings ofGpu;
    ofGpu.draw.exact = false;
    ofGpu.budgetBytes = kBudgetBytes;
    const auto stream = std::make_shared<GpuStream>(context_);
    return std::make_unique<GpuSceneRenderer>(stream, makeGpuMeshDrawer(stream, settings), open(), ofGpu);
  }
  const std::string& name() const { return context_->name(); }

 private:
  TileScene open() const { return openTileScene(scene_, meshCodec()); }

  fs::path scene_;
  std::shared_ptr<const GpuContext> context_;
  std::unique_ptr<SceneRenderer> oracle_;
};

nlohmann::ordered_json describe(const std::vector<double>& decibels) {
  double sum = 0;
  for (const double value : decibels) sum += value;
  return {{"least", *std::min_element(decibels.begin(), decibels.end())},
          {"mean", sum / static_cast<double>(decibels.size())}};
}

// The images of single views.
void compareViews(Renderers& renderers, const std::vector<View>& views, nlohmann::ordered_json& result) {
  const auto gpu = renderers.onGpu({.jitters = false, .blends = true});
  std::vector<double> exact, lens, once, mean;
  for (const View& view : views) {
    const ImageF expected = renderers.expected(view.pinhole, view.worldFromCamera);
    exact.push_back(psnr(gpu->render(view.pinhole, view.worldFromCamera, nullptr).colour, expected));
    lens.push_back(psnr(gpu->render(view.lens, view.worldFromCamera, nullptr).colour,
                        renderers.expected(view.lens, view.worldFromCamera)));
    for (int frame = 0; frame < kFramesOfMean; ++frame) {
      gpu->draw(view.pinhole, view.worldFromCamera);
      if (frame == 0) once.push_back(psnr(gpu->lastImage().colour, expected));
    }
    mean.push_back(psnr(gpu->lastImage().colour, expected));
  }
  result["exact"] = describe(exact);
  result["exact_through_lens"] = describe(lens);
  result["one_frame"] = describe(once);
  result[fmt::format("{}_frames", kFramesOfMean)] = describe(mean);
}

// The time of a frame with the network evaluated once per pixel, and for every fragment, as in the paper. Both draw the
// same views in turns, and the faster of two frames counts.
void compareDecoders(Renderers& renderers, const std::vector<View>& views, nlohmann::ordered_json& result) {
  const std::array<std::unique_ptr<GpuSceneRenderer>, 2> gpu = {renderers.onGpu({.decodesFragments = false}),
                                                                renderers.onGpu({.decodesFragments = true})};
  std::array<double, 2> seconds = {0, 0};
  for (const View& view : views) {
    std::array<double, 2> fastest = {INFINITY, INFINITY};
    for (int frame = 0; frame < 3; ++frame) {
      for (size_t kind = 0; kind < gpu.size(); ++kind) {
        const auto begin = std::chrono::steady_clock::now();
        gpu[kind]->draw(view.pinhole, view.worldFromCamera);
        gpu[kind]->lastImage();  // waits
        const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
        if (frame > 0) fastest[kind] = std::min(fastest[kind], taken.count());  // the first one loads tiles
      }
    }
    for (size_t kind = 0; kind < gpu.size(); ++kind) seconds[kind] += fastest[kind] / static_cast<double>(views.size());
  }
  result["seconds_of_frame"] = {{"decoded_once_per_pixel", seconds[0]}, {"every_fragment_decoded", seconds[1]}};
}

// The frames of a flight from each view towards the next one.
void compareFlight(Renderers& renderers, const std::vector<View>& views, nlohmann::ordered_json& result) {
  const std::array<std::pair<const char*, GpuMeshSettings>, 2> kinds = {{
      {"without_blending", {.blends = false}},
      {"with_blending", {.blends = true}},
  }};
  std::vector<std::unique_ptr<GpuSceneRenderer>> renderer;
  for (const auto& [name, settings] : kinds) renderer.push_back(renderers.onGpu(settings));
  std::array<std::vector<double>, kinds.size()> sharp, smooth;
  double largestLoss = -INFINITY;
  for (size_t i = 0; i + 1 < views.size(); ++i) {
    // Each stretch begins at rest. Frames are not blended with those of another one, as an exact image is between them.
    for (const auto& one : renderer) {
      one->render(views[i].pinhole, views[i].worldFromCamera, nullptr);
      for (int frame = 0; frame < kFramesAtRest; ++frame) one->draw(views[i].pinhole, views[i].worldFromCamera);
    }
    const Eigen::Quaterniond from(views[i].worldFromCamera.rotation), to(views[i + 1].worldFromCamera.rotation);
    const Vec3d way = views[i + 1].worldFromCamera.translation - views[i].worldFromCamera.translation;
    for (int frame = 1; frame <= kFramesOfView; ++frame) {
      const double share = std::min(1.0, frame * kMetresOfFrame / way.norm());
      Pose pose;
      pose.rotation = from.slerp(share, to).toRotationMatrix();
      pose.translation = views[i].worldFromCamera.translation + share * way;
      const Camera& camera = views[i].pinhole;
      const ImageF expected = renderers.expected(camera, pose);
      const bool isCompared = frame % kFramesOfSmooth == 0;  // with 16 samples of each pixel, which take long
      const ImageF mean = isCompared ? renderers.smooth(camera, pose) : ImageF();
      for (size_t kind = 0; kind < kinds.size(); ++kind) {
        renderer[kind]->draw(camera, pose);
        const ImageF drawn = renderer[kind]->lastImage().colour;
        sharp[kind].push_back(psnr(drawn, expected));
        if (isCompared) smooth[kind].push_back(psnr(drawn, mean));
      }
      largestLoss = std::max(largestLoss, sharp[0].back() - sharp[1].back());
    }
  }
  nlohmann::ordered_json flight = {{"frames", sharp[0].size()}, {"metres_of_frame", kMetresOfFrame}};
  for (size_t kind = 0; kind < kinds.size(); ++kind) {
    flight[kinds[kind].first] = describe(sharp[kind]);
    flight[kinds[kind].first]["against_16_samples"] = describe(smooth[kind]);
  }
  flight["largest_loss_by_blending"] = largestLoss;
  result["flight"] = flight;
}

int run(int argc, char** argv) {
  if (argc < 3 || argc > 4) {
    std::fprintf(stderr, "usage: mesh_frames SCENE CAPTURE [WIDTHxHEIGHT]\n");
    return 2;
  }
  int width = 0, height = 0;
  if (argc == 4 && std::sscanf(argv[3], "%dx%d", &width, &height) != 2) {
    std::fprintf(stderr, "mesh_frames: %s is not a size\n", argv[3]);
    return 2;
  }
  const std::vector<View> views = heldOutViews(readCapture(argv[2]), width, height);
  Renderers renderers(argv[1]);
  nlohmann::ordered_json result = {{"device", renderers.name()}, {"views", views.size()}};
  const char* const only = std::getenv("ONLY");
  const auto isWanted = [only](const char* row) { return only == nullptr || std::string_view(only) == row; };
  if (isWanted("decoders")) compareDecoders(renderers, views, result);
  if (isWanted("views")) compareViews(renderers, views, result);
  if (isWanted("flight")) compareFlight(renderers, views, result);
  std::printf("%s\n", result.dump(2).c_str());
  return 0;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  try {
    return tessera::run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "mesh_frames: %s\n", error.what());
    return 1;
  }
}
