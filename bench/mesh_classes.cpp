// mesh_classes [--binarised] SCENE CAPTURE [SCENE ...]: the error of mesh scenes in the held-out photos of a synthetic
// city, by what a pixel shows: the ray through its centre is followed to the first surface of the city itself. Leaves
// are cut out exactly, and wires are often thinner than a pixel, so a pixel that shows some of one may count as what is
// behind it. With --binarised, opacities of texels are 1 from 0.5 on, and else 0, at all levels. Prints a JSON list
// with an object for each scene: for all pixels, for those of surfaces and for each class the number of pixels, their
// share, and the PSNR of their mean squared error, which is null where there are none; and SSIM and LPIPS of the photos
// (the latter with the weights that LPIPS names). See mesh.sh.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "bench/evaluation.h"
#include "bench/mesh_scene.h"
#include "bench/synthetic_city.h"
#include "eval/evaluate.h"
#include "eval/psnr.h"
#include "import/capture_reader.h"
#include "representations/mesh/content/mesh_content.h"
#include "representations/mesh/cpu/mesh_drawer.h"
#include "tiles/bc4.h"

namespace tessera {
namespace {

constexpr float kOpaqueFrom = 0.5f;

// Draws contents whose texels are either opaque or transparent.
class BinarisingDrawer final : public ChangedMeshDrawer {
 public:
  std::unique_ptr<Content> prepare(std::unique_ptr<Content> content, int threads) const override {
    MeshContent mesh = contentAs<MeshContent>(*content);
    for (PatchSet& part : mesh.parts) {
      if (part.encoder) part.encoder->opaqueFrom = part.encoder->transparentBelow = kOpaqueFrom;  // of inferred maps
      for (size_t at = 0; at < part.opacityBlocks.size(); at += PatchSet::kBc4Bytes) {
        Bc4Texels texels;
        for (uint32_t i = 0; i < texels.size(); ++i)
          texels[i] = decodeBc4Texel(&part.opacityBlocks[at], i) >= 255 * kOpaqueFrom ? 255 : 0;
        const Bc4Block block = encodeBc4(texels, Bc4Effort::fast);
        std::copy(block.begin(), block.end(), part.opacityBlocks.begin() + static_cast<ptrdiff_t>(at));
      }
    }
    return ChangedMeshDrawer::prepare(makeContent(std::move(mesh)), threads);
  }
};

constexpr int kClasses = kSurfaceClasses + 1;

// Returns the class of each pixel.
std::vector<int> classify(const CityScene& city, const Camera& camera, const Pose& pose, ThreadPool& pool) {
  std::vector<int> classes(static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height), kSky);
  pool.run(static_cast<size_t>(camera.height), [&](size_t y, int) {
    for (int x = 0; x < camera.width; ++x) {
      const auto ray = rayThrough(camera, pose, {x + 0.5, static_cast<double>(y) + 0.5});
      const auto hit = ray ? city.tracer->intersect(*ray) : std::nullopt;
      if (hit) classes[y * static_cast<size_t>(camera.width) + x] = static_cast<int>(classOfMaterial(hit->material));
    }
  });
  return classes;
}

struct ClassError {
  double squares = 0;
  uint64_t pixels = 0;

  void add(const ClassError& other) {
    squares += other.squares;
    pixels += other.pixels;
  }
  nlohmann::ordered_json describe(uint64_t all) const {
    nlohmann::ordered_json result = {
        {"pixels", pixels}, {"share", static_cast<double>(pixels) / static_cast<double>(all)}, {"psnr", nullptr}};
    if (pixels > 0) result["psnr"] = psnrFromMeanSquaredError(squares / (3 * static_cast<double>(pixels)));
    return result;
  }
};

nlohmann::ordered_json judge(const fs::path& folder, const Capture& capture, bool binarised,
                             const std::map<std::string, std::vector<int>>& classesOfPhotos) {
  const OpenedMeshScene scene =
      openMeshScene(folder, binarised ? std::make_unique<BinarisingDrawer>() : makeMeshDrawer());
  std::array<ClassError, kClasses> errors;
  EvaluateOptions options = optionsOfEnvironment();
  options.onView = [&](const ViewResult& view, const ViewPictures& pictures) {
    const std::vector<int>& classes = classesOfPhotos.at(view.name);
    for (size_t pixel = 0; pixel < classes.size(); ++pixel) {
      if (pictures.mask != nullptr && pictures.mask->pixels[pixel] == 0) continue;
      ClassError error{0, 1};
      for (size_t i = 3 * pixel; i < 3 * pixel + 3; ++i) {
        const double difference = pictures.rendered.pixels[i] - pictures.photo.pixels[i];
        error.squares += difference * difference;
      }
      errors[classes[pixel]].add(error);
    }
  };
  const EvaluationReport report = evaluate(*scene.renderer, capture, options);
  ClassError surfaces;
  for (int i = 0; i < kSurfaceClasses; ++i) surfaces.add(errors[i]);
  ClassError all = surfaces;
  all.add(errors[kSky]);
  nlohmann::ordered_json result = {{"scene", folder.filename().string()},
                                   {"binarised", binarised},
                                   {"photos", describeQuality(report)},
                                   {"all", all.describe(all.pixels)},
                                   {"surfaces", surfaces.describe(all.pixels)}};
  for (int i = 0; i < kClasses; ++i) result[kClassNames[i]] = errors[i].describe(all.pixels);
  return result;
}

nlohmann::ordered_json measure(const std::vector<fs::path>& scenes, const fs::path& captureFolder, bool binarised) {
  const Capture capture = readCapture(captureFolder);
  ThreadPool pool(0);
  std::map<std::string, std::vector<int>> classesOfPhotos;  // by name
  {
    const std::unique_ptr<CityScene> city = rebuildCity(captureFolder, pool);
    for (const int number : capture.photosIn(Split::test)) {
      const Photo& photo = capture.photos[number];
      classesOfPhotos[photo.name] = classify(*city, capture.cameras[photo.camera], photo.worldFromCamera, pool);
    }
  }
  nlohmann::ordered_json results = nlohmann::ordered_json::array();
  for (const fs::path& scene : scenes) results.push_back(judge(scene, capture, binarised, classesOfPhotos));
  return results;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  std::vector<std::string> arguments(argv + 1, argv + argc);
  const bool binarised = std::erase(arguments, "--binarised") > 0;
  if (arguments.size() < 2) {
    std::fprintf(stderr, "usage: mesh_classes [--binarised] SCENE CAPTURE [SCENE ...]\n");
    return 2;
  }
  try {
    std::vector<tessera::fs::path> scenes = {arguments[0]};
    scenes.insert(scenes.end(), arguments.begin() + 2, arguments.end());
    std::printf("%s\n", tessera::measure(scenes, arguments[1], binarised).dump(2).c_str());
    return 0;
  } catch (const tessera::Error& error) {
    std::fprintf(stderr, "mesh_classes: error: %s\n", error.what());
    return 1;
  }
}
