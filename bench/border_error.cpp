// border_error MODEL|SCENE CAPTURE BLOCKS_JSON [SHARE]: where in held-out views the errors are. Each pixel's surface
// point is projected onto the ground of BLOCKS_JSON's grid: by the photo's depth map, so that everything that is
// compared uses the same pixels, or by the rendered depth if there is none. Prints, as JSON, the mean squared error
// (RGB in [0,1]) in
//   border    within SHARE (0.05) of a block's edge length from a wall between two blocks
//   rim       as close to the grid's outer walls, whatever else is near
//   interior  the rest of the blocks
// Pixels outside the blocks and of the sky do not count. See consistency.sh.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "apps/tessera/render_source.h"
#include "base/error.h"
#include "eval/evaluate.h"
#include "import/capture_reader.h"
#include "train/model_folder.h"

namespace tessera {
namespace {

enum Place { kBorder, kRim, kInterior, kOutside };
constexpr const char* kPlaces[] = {"border", "rim", "interior", "outside"};

Place classifyPoint(const BlockGrid& grid, const Vec3d& xInWorld, double share) {
  const Vec3d x = grid.inGrid(xInWorld);
  if (!(x.z() >= grid.bottom && x.z() <= grid.top)) return kOutside;
  double toRim = INFINITY, toWall = INFINITY;  // in block edges
  const int counts[] = {grid.columns, grid.rows};
  for (int axis = 0; axis < 2; ++axis) {
    const double at = x[axis] / grid.edge + 0.5 * counts[axis];
    if (!(at >= 0 && at <= counts[axis])) return kOutside;
    toRim = std::min({toRim, at, counts[axis] - at});
    if (counts[axis] == 1) continue;
    const double wall = std::clamp(std::round(at), 1.0, counts[axis] - 1.0);
    toWall = std::min(toWall, std::abs(at - wall));
  }
  return toRim <= share ? kRim : toWall <= share ? kBorder : kInterior;
}

struct Errors {
  double squares[4] = {};
  int64_t pixels[4] = {};

  double mse(Place place) const { return squares[place] / (3.0 * static_cast<double>(pixels[place])); }
};

void add(Errors& errors, const ViewPictures& pictures, const Camera& camera, const Pose& pose, const BlockGrid& grid,
         double share) {
  std::optional<ImageF> measured;
  if (pictures.measuredDepth) measured = resampledToNearest(*pictures.measuredDepth, camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      if (pictures.mask && *pictures.mask->at(x, y) == 0) continue;
      const std::optional<Vec3d> direction = camera.directionInCamera({x + 0.5, y + 0.5});
      const double opacity = *pictures.view.opacity.at(x, y);
      const double depth = measured ? *measured->at(x, y) : opacity > 0.5 ? *pictures.view.depth.at(x, y) / opacity : 0;
      Place place = kOutside;
      if (direction && direction->z() > 0 && depth > 0 && std::isfinite(depth)) {
        const Vec3d xInWorld = pose.translation + pose.rotation * *direction * (depth / direction->z());
        place = classifyPoint(grid, xInWorld, share);
      }
      for (int c = 0; c < 3; ++c) {
        const double difference = pictures.rendered.at(x, y)[c] - pictures.photo.at(x, y)[c];
        errors.squares[place] += difference * difference;
      }
      ++errors.pixels[place];
    }
  }
}

nlohmann::ordered_json measure(const fs::path& what, const fs::path& captureFolder, const fs::path& blocks,
                               double share) {
  const Capture capture = readCapture(captureFolder);
  const BlockGrid grid = readGrid(blocks, capture);
  const std::unique_ptr<Device> device = makeDevice({});
  const std::unique_ptr<RenderSource> renderSource = openRenderSource(*device, what, {});
  renderSource->requireMatchingWorld(capture);
  EvaluateOptions options;
  const std::vector<int> photos = capture.photosIn(options.split);
  Errors errors;
  size_t done = 0;
  options.onView = [&](const ViewResult&, const ViewPictures& pictures) {
    const Photo& photo = capture.photos[static_cast<size_t>(photos[done++])];
    add(errors, pictures, capture.cameras[static_cast<size_t>(photo.camera)], photo.worldFromCamera, grid, share);
  };
  nlohmann::ordered_json result = {{"psnr", evaluate(renderSource->renderer(), capture, options).psnr},
                                   {"share", share}};
  for (const Place place : {kBorder, kRim, kInterior, kOutside}) {
    result[kPlaces[place]] = {{"pixels", errors.pixels[place]}, {"mse", errors.mse(place)}};
  }
  const double ratio = errors.mse(kBorder) / errors.mse(kInterior);
  result["mse_ratio"] = ratio;
  result["rmse_ratio"] = std::sqrt(ratio);
  return result;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  const double share = argc > 4 ? std::atof(argv[4]) : 0.05;
  if (argc < 4 || argc > 5 || !(share > 0 && share < 0.5)) {
    std::fprintf(stderr, "border_error MODEL|SCENE CAPTURE BLOCKS_JSON [SHARE]\n");
    return 2;
  }
  try {
    std::printf("%s\n", tessera::measure(argv[1], argv[2], argv[3], share).dump(2).c_str());
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "border_error: %s\n", error.what());
    return 1;
  }
}
