// Frames of a scene rendered on the window's own device.
#pragma once

#include <chrono>
#include <memory>

#include "apps/viewer/dynamic_resolution.h"
#include "apps/viewer/frame_source.h"
#include "render/vulkan/gpu_scene_renderer.h"

namespace tessera {

class GpuFrameSource final : public FrameSource {
 public:
  // The renderer's stream must belong to the context that the window was made with.
  explicit GpuFrameSource(std::unique_ptr<GpuViewRenderer> renderer) : renderer_(std::move(renderer)) {}

  ShownPicture update(const Camera& window, const Pose& worldFromCamera, bool moving) override;
  Eigen::Array3f background() const override { return renderer_->background(); }
  std::optional<Vec3d> placeAt(double right, double down) override;
  Facts facts() const override;

 private:
  using Clock = std::chrono::steady_clock;

  std::unique_ptr<GpuViewRenderer> renderer_;
  DynamicResolution resolution_{40};
  ShownPicture shown_;
  Camera camera_;  // of the last frame
  Pose pose_;
  std::optional<Clock::time_point> begun_;  // start of the last frame, if another directly preceded it
};

}  // namespace tessera
