// Pictures that take long, drawn by a thread of its own: a few pixels at first, all of them when the camera rests.
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "apps/viewer/pace.h"
#include "apps/viewer/picture_source.h"
#include "gpu/stream.h"
#include "scene/view_renderer.h"

namespace tessera {

// What is drawn, and becomes another thing while one looks: a model in training.
class ChangingRenderer {
 public:
  virtual ~ChangingRenderer() = default;
  // Asked every now and then by the thread that draws. True where pictures drawn so far are out of date.
  virtual bool refresh() = 0;
  virtual ViewRenderer& renderer() = 0;
  virtual PictureSource::Facts facts() const = 0;  // on the thread that draws
};

class WorkerPictures final : public PictureSource {
 public:
  // Pictures go to the window's device by `context`.
  WorkerPictures(const std::shared_ptr<const GpuContext>& context, std::unique_ptr<ChangingRenderer> drawn);
  ~WorkerPictures() override;  // waits for the piece of a picture that is being drawn

  ShownPicture update(const Camera& window, const Pose& worldFromCamera, bool moving) override;
  Eigen::Array3f background() const override {
    const std::lock_guard lock(mutex_);
    return background_;
  }
  std::optional<Vec3d> placeAt(double right, double down) override;
  Facts facts() const override;

 private:
  struct Request {
    Camera window;
    Pose worldFromCamera;
    bool moving = false;
    bool operator==(const Request& other) const {
      return window == other.window && moving == other.moving &&
             worldFromCamera.rotation == other.worldFromCamera.rotation &&
             worldFromCamera.translation == other.worldFromCamera.translation;
    }
  };
  struct Made {
    RenderedView view;
    Request of;
    bool isWhole = false;
  };

  void work();
  void drawFor(const Request& request);
  // Nothing where another view has been asked for meanwhile.
  std::optional<RenderedView> drawInBands(const Camera& camera, const Request& request);
  bool isOutdated(const Request& request);
  void hand(RenderedView view, const Request& request, bool isWhole);

  std::shared_ptr<GpuStream> stream_;
  GpuBuffer pixels_;
  ShownPicture shown_;
  Made view_;  // that is shown

  // Of the thread that draws:
  std::unique_ptr<ChangingRenderer> drawn_;
  Pace pace_{100, Pace::Begin::few};
  std::optional<Request> done_;
  double secondsOfPixel_ = 1e-4;  // that it took to draw one, lately

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Request> request_;
  std::optional<Made> made_;
  Facts facts_;
  Eigen::Array3f background_ = Eigen::Array3f::Zero();
  std::exception_ptr failure_;
  bool ends_ = false;
  std::thread thread_;
};

}  // namespace tessera
