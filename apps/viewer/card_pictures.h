// Pictures of a scene that the window's own device draws.
#pragma once

#include <chrono>
#include <memory>

#include "apps/viewer/pace.h"
#include "apps/viewer/picture_source.h"
#include "render/vulkan/gpu_scene_renderer.h"

namespace tessera {

class CardPictures final : public PictureSource {
 public:
  // The renderer's stream is the context's that the window was made with.
  explicit CardPictures(std::unique_ptr<GpuViewRenderer> renderer) : renderer_(std::move(renderer)) {}

  ShownPicture update(const Camera& window, const Pose& worldFromCamera, bool moving) override;
  Eigen::Array3f background() const override { return renderer_->background(); }
  std::optional<Vec3d> placeAt(double right, double down) override;
  Facts facts() const override;

 private:
  using Clock = std::chrono::steady_clock;

  std::unique_ptr<GpuViewRenderer> renderer_;
  Pace pace_{40};
  ShownPicture shown_;
  Camera camera_;  // of the last picture
  Pose pose_;
  std::optional<Clock::time_point> begun_;  // of the last picture, where another came right before
};

}  // namespace tessera
