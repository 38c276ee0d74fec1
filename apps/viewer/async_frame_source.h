// Frames that take long to render, drawn by a thread of its own: few pixels at first, all of them once the camera
// rests.
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "apps/viewer/dynamic_resolution.h"
#include "apps/viewer/frame_source.h"
#include "gpu/stream.h"
#include "scene/view_renderer.h"

namespace tessera {

// A renderer whose subject changes while it is being viewed: a model in training.
class ChangingRenderer {
 public:
  virtual ~ChangingRenderer() = default;
  // Called every now and then by the drawing thread. Returns whether the images drawn so far are out of date.
  virtual bool refresh() = 0;
  virtual ViewRenderer& renderer() = 0;
  virtual FrameSource::Facts facts() const = 0;  // called on the drawing thread
};

class AsyncFrameSource final : public FrameSource {
 public:
  // Images are uploaded to the window's device through `context`.
  AsyncFrameSource(const std::shared_ptr<const GpuContext>& context, std::unique_ptr<ChangingRenderer> drawn);
  ~AsyncFrameSource() override;  // waits for the band that is being drawn

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
    bool isComplete = false;
  };

  void work();
  void drawFor(const Request& request);
  // Returns nothing if another view has been requested in the meantime.
  std::optional<RenderedView> drawInBands(const Camera& camera, const Request& request);
  bool isOutdated(const Request& request);
  void hand(RenderedView view, const Request& request, bool isComplete);

  std::shared_ptr<GpuStream> stream_;
  GpuBuffer pixels_;
  ShownPicture shown_;
  Made view_;  // the view that is shown

  // Used only by the drawing thread:
  std::unique_ptr<ChangingRenderer> drawn_;
  DynamicResolution resolution_{100, DynamicResolution::Begin::few};
  std::optional<Request> done_;
  double secondsOfPixel_ = 1e-4;  // running estimate of the time to draw one pixel

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
