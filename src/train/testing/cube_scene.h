// For tests: an analytic scene, a cube with six chequered faces, alone or inside a coloured box, with rendered photos.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <limits>
#include <string>

#include "base/image_io.h"
#include "base/random.h"
#include "scene/block_grid.h"
#include "scene/capture.h"
#include "scene/view_renderer.h"

namespace tessera {

class CubeScene {
 public:
  struct Options {
    bool isEnclosed = false;  // else photos are transparent around the cube
    LensModel lens = LensModel::pinhole;
    std::vector<double> log2Gains = {0};  // exposures of the photos, in turn
    bool stain = false;                   // a red stain, masked, in a corner of every training photo
    int photos = 48;
    int observationsPerPhoto = 0;  // without error
  };

  static constexpr int kWidth = 40, kHeight = 32, kStain = 12;
  static constexpr double kCube = 0.5, kEnclosure = 2.5;  // half sides

  CubeScene() : CubeScene(Options()) {}
  explicit CubeScene(const Options& options) : options_(options) {
    static int count = 0;
    root_ = fs::temp_directory_path() / ("tessera-cube-" + std::to_string(::getpid()) + "-" + std::to_string(count++));
    fs::remove_all(root_);
    fs::create_directories(root_);
    makeCapture();
  }
  ~CubeScene() { fs::remove_all(root_); }
  CubeScene(const CubeScene&) = delete;

  const Capture& capture() const { return capture_; }
  Capture& capture() { return capture_; }
  fs::path operator/(const std::string& name) const { return root_ / name; }

  // Renders the ground truth: premultiplied colour, opacity and z-depth (0 where there is nothing).
  RenderedView truth(const Camera& camera, const Pose& pose) const {
    RenderedView view = makeEmptyView(camera);
    constexpr int kGrid = 3;  // subpixels
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        for (int sub = 0; sub < kGrid * kGrid; ++sub) {
          const Vec2d pixel(x + (sub % kGrid + 0.5) / kGrid, y + (sub / kGrid + 0.5) / kGrid);
          const auto direction = camera.directionInCamera(pixel);
          if (!direction) continue;
          Vec3d colour = Vec3d::Zero();
          const double distance = trace(pose.translation - centre(), pose.rotation * *direction, &colour);
          if (!std::isfinite(distance)) continue;
          for (int k = 0; k < 3; ++k) view.colour.at(x, y)[k] += static_cast<float>(colour[k] / (kGrid * kGrid));
          *view.opacity.at(x, y) += 1.0f / (kGrid * kGrid);
          *view.depth.at(x, y) += static_cast<float>(distance * direction->z() / (kGrid * kGrid));
        }
      }
    }
    return view;
  }
  static Vec3d centre() { return {10, -5, 2}; }

 private:
  // Slab test with the cube of half side `half`: returns its near distance, or its far one if `inside`; infinity for a
  // miss.
  static double box(const Vec3d& from, const Vec3d& along, double half, bool inside, int* face) {
    double enter = -1e30, leave = 1e30;
    int enterFace = 0, leaveFace = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double a = (-half - from[axis]) / along[axis], b = (half - from[axis]) / along[axis];
      const int side = 2 * axis + (along[axis] < 0);
      if (std::min(a, b) > enter) enter = std::min(a, b), enterFace = side;
      if (std::max(a, b) < leave) leave = std::max(a, b), leaveFace = side ^ 1;
    }
    *face = inside ? leaveFace : enterFace;
    if (enter > leave || leave < 0) return std::numeric_limits<double>::infinity();
    return inside ? leave : enter;
  }
  double trace(const Vec3d& from, const Vec3d& along, Vec3d* colour) const {
    int face = 0;
    double half = kCube, distance = box(from, along, kCube, false, &face);
    if (!std::isfinite(distance) && options_.isEnclosed) distance = box(from, along, half = kEnclosure, true, &face);
    if (!std::isfinite(distance)) return distance;
    const Vec3d at = (from + distance * along) / half;
    const int u = (face / 2 + 1) % 3, v = (face / 2 + 2) % 3;
    const int chequer = static_cast<int>(std::floor(2 * at[u]) + std::floor(2 * at[v]));
    const double share = half == kCube ? 1 : 0.55;
    *colour = share * Vec3d(face & 1 ? 0.8 : 0.2, face & 2 ? 0.75 : 0.3, face & 4 ? 0.7 : 0.25);
    if (chequer % 2 != 0) *colour *= 0.7;
    return distance;
  }

  void makeCapture() {
    capture_.root = root_;
    Camera camera;
    camera.width = kWidth;
    camera.height = kHeight;
    camera.lens = options_.lens;
    const double focal = options_.lens == LensModel::pinhole ? 42 : 30;
    camera.parameters = {focal, focal, kWidth / 2.0, kHeight / 2.0};
    if (options_.lens == LensModel::openCvFisheye) camera.parameters[4] = -0.02;
    capture_.cameras.push_back(camera);
    for (int i = 0; i < options_.photos; ++i) {
      Photo photo;
      photo.name = "photo_" + std::to_string(i) + ".png";
      photo.image = root_ / photo.name;
      photo.split = i % 7 == 3 ? Split::test : Split::train;
      // Cameras lie on a spiral over a sphere.
      const double z = 0.85 * (2 * (i + 0.5) / options_.photos - 1), angle = 2.4 * i;
      const double across = std::sqrt(1 - z * z);
      const Vec3d outward(across * std::cos(angle), across * std::sin(angle), z);
      const Vec3d right = -outward.cross(Vec3d::UnitZ()).normalized();
      photo.worldFromCamera.translation = centre() + 1.9 * outward;
      photo.worldFromCamera.rotation.col(0) = right;
      photo.worldFromCamera.rotation.col(1) = (-outward).cross(right);
      photo.worldFromCamera.rotation.col(2) = -outward;
      writePhoto(photo, camera, i);
      capture_.photos.push_back(photo);
      for (int k = 0; k < options_.observationsPerPhoto; ++k) observe(i, camera, k);
    }
  }

  // Adds a sparse point on the ray through the centre of a random pixel, if the ray hits anything.
  void observe(int index, const Camera& camera, int k) {
    const RandomStream random(9, static_cast<uint64_t>(index));
    const Vec2d pixel(random.below(2 * k, kWidth) + 0.5, random.below(2 * k + 1, kHeight) + 0.5);
    const Pose& pose = capture_.photos[index].worldFromCamera;
    Vec3d colour;
    const Vec3d along = pose.rotation * *camera.directionInCamera(pixel);
    const double distance = trace(pose.translation - centre(), along, &colour);
    if (!std::isfinite(distance)) return;
    capture_.observations.push_back({static_cast<uint32_t>(index), static_cast<uint32_t>(capture_.points.size()),
                                     static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 0});
    capture_.points.push_back({pose.translation + distance * along, {}, 0});
  }

  void writePhoto(Photo& photo, const Camera& camera, int index) const {
    const RenderedView view = truth(camera, photo.worldFromCamera);
    ImageF image(kWidth, kHeight, options_.isEnclosed ? 3 : 4);
    const double gain = std::exp2(options_.log2Gains[index % options_.log2Gains.size()]);
    for (size_t i = 0; i < view.opacity.pixels.size(); ++i) {
      const float opacity = view.opacity.pixels[i];
      float* pixel = &image.pixels[i * image.channels];
      for (int k = 0; k < 3; ++k) {
        const float straight = opacity > 0 ? view.colour.pixels[3 * i + k] / opacity : 0;
        pixel[k] = static_cast<float>(gain) * straight;
      }
      if (image.channels == 4) pixel[3] = opacity;
    }
    if (options_.stain && photo.split == Split::train) {
      ImageU8 mask(kWidth, kHeight, 1, 255);
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          // The corner differs between photos, so that every part of the scene is visible in some photo.
          const bool left = index % 2 == 0, top = index % 3 == 0;
          if ((left ? x : kWidth - 1 - x) >= kStain || (top ? y : kHeight - 1 - y) >= kStain) continue;
          const float red[] = {1, 0, 0, 1};
          std::copy(red, red + image.channels, image.at(x, y));
          *mask.at(x, y) = 0;
        }
      }
      photo.mask = root_ / ("mask_" + photo.name);
      writePng(photo.mask, mask);
    }
    writePng(photo.image, toBytes(image));
  }

  Options options_;
  fs::path root_;
  Capture capture_;
};

// PSNR of premultiplied colours over black, in the given range of pixels.
inline double computePsnr(const RenderedView& view, const RenderedView& truth, int fromX = 0, int toX = 1 << 20,
                          int fromY = 0, int toY = 1 << 20) {
  double sum = 0;
  int64_t count = 0;
  for (int y = fromY; y < std::min(toY, truth.colour.height); ++y) {
    for (int x = fromX; x < std::min(toX, truth.colour.width); ++x) {
      for (int k = 0; k < 3; ++k) {
        const double difference = view.colour.at(x, y)[k] - truth.colour.at(x, y)[k];
        sum += difference * difference;
        ++count;
      }
    }
  }
  return -10 * std::log10(sum / static_cast<double>(count));
}

// Returns the mean PSNR over the held-out photos.
inline double heldOutPsnr(const CubeScene& scene, ViewRenderer& renderer) {
  double sum = 0;
  const std::vector<int> photos = scene.capture().photosIn(Split::test);
  for (const int index : photos) {
    const Photo& photo = scene.capture().photos[index];
    const Camera& camera = scene.capture().cameras[photo.camera];
    sum += computePsnr(renderer.render(camera, photo.worldFromCamera, nullptr),
                       scene.truth(camera, photo.worldFromCamera));
  }
  return sum / static_cast<double>(photos.size());
}

// A grid around the cube, whose half side is 0.5: one block, or two (2, 1) or four (2, 2) that meet at its centre.
inline BlockGrid cubeGrid(int columns = 1, int rows = 1) {
  BlockGrid grid;
  grid.originInWorld = CubeScene::centre();
  grid.edge = 1.4;
  grid.columns = columns;
  grid.rows = rows;
  grid.bottom = -0.7;
  grid.top = 0.7;
  return grid;
}

}  // namespace tessera
