// For tests: a small capture on disk, and a renderer that returns given images.
#pragma once

#include <unistd.h>

#include <cmath>
#include <functional>
#include <string>

#include "base/image_io.h"
#include "base/random.h"
#include "scene/capture.h"
#include "scene/view_renderer.h"

namespace tessera {

inline ImageU8 fakePhoto(int width, int height, uint64_t seed) {
  ImageU8 image(width, height, 3);
  const RandomStream random(seed, 0);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const double wave = 0.5 + 0.3 * std::sin(0.13 * x * (c + 1) + 0.07 * y + static_cast<double>(seed));
        const uint64_t index = (static_cast<uint64_t>(y) * width + x) * 3 + c;
        image.at(x, y)[c] = static_cast<uint8_t>(255 * wave + 20 * random.uniform(index));
      }
    }
  }
  return image;
}

// Photos in a temporary folder, which the destructor removes. The camera of photo i lies at x = i.
class FakeCapture {
 public:
  explicit FakeCapture(const std::string& name) {
    capture.root = fs::temp_directory_path() / ("tessera_" + name + "_" + std::to_string(::getpid()));
    fs::remove_all(capture.root);
    Camera camera;
    camera.width = 64;
    camera.height = 48;
    camera.parameters = {60, 60, 32, 24};
    capture.cameras.push_back(camera);
  }
  ~FakeCapture() { fs::remove_all(capture.root); }

  Photo& add(const std::string& name, const ImageU8& image, Split split = Split::test) {
    Photo photo;
    photo.name = name;
    photo.image = capture.root / ("photo_" + std::to_string(capture.photos.size()) + ".png");
    photo.split = split;
    photo.worldFromCamera.translation.x() = static_cast<double>(capture.photos.size());
    writePng(photo.image, image);
    capture.photos.push_back(photo);
    return capture.photos.back();
  }

  Capture capture;
};

class FakeRenderer : public ViewRenderer {
 public:
  using Draw = std::function<RenderedView(const Camera&, int photo)>;

  explicit FakeRenderer(Draw draw) : draw_(std::move(draw)) {}
  // Returns these opaque images by photo.
  explicit FakeRenderer(std::vector<ImageF> pictures)
      : FakeRenderer([pictures = std::move(pictures)](const Camera& camera, int photo) {
          return RenderedView{pictures.at(static_cast<size_t>(photo)), ImageF(camera.width, camera.height, 1, 1.0f),
                              ImageF(camera.width, camera.height, 1, 2.0f)};
        }) {}

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF*) override {
    return draw_(camera, static_cast<int>(worldFromCamera.translation.x()));
  }
  std::string device() const override { return "fake <device>"; }
  Eigen::Array3f background() const override { return colourBehind; }
  bool showsOutside() const override { return hasOutside; }
  std::string whyNotThrough(const Camera&) const override { return refusal; }

  Eigen::Array3f colourBehind = Eigen::Array3f::Zero();
  bool hasOutside = true;
  std::string refusal;  // of all cameras

 private:
  Draw draw_;
};

}  // namespace tessera
