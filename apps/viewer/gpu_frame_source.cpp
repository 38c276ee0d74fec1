#include "apps/viewer/gpu_frame_source.h"

#include <fmt/format.h>

namespace tessera {

ShownPicture GpuFrameSource::update(const Camera& window, const Pose& worldFromCamera, bool moving) {
  const Camera camera = inPixels(window, moving ? resolution_.share() : 1);
  const bool isSame = camera == camera_ && worldFromCamera.rotation == pose_.rotation &&
                      worldFromCamera.translation == pose_.translation;
  shown_.isNew = !isSame || renderer_->hasMore();
  if (!shown_.isNew) {
    shown_.isComplete = !moving && renderer_->state().missing == 0 && camera == camera_;
    begun_.reset();
    return shown_;
  }
  // Measures from frame to frame, which includes the device, the screen and this program.
  const Clock::time_point now = Clock::now();
  if (begun_ && moving) resolution_.took(std::chrono::duration<double, std::milli>(now - *begun_).count());
  begun_ = moving ? std::optional(now) : std::nullopt;
  shown_.onGpu = renderer_->draw(camera, worldFromCamera);
  shown_.isComplete = !moving && renderer_->state().missing == 0 && !renderer_->hasMore();
  camera_ = camera;
  pose_ = worldFromCamera;
  return shown_;
}

std::optional<Vec3d> GpuFrameSource::placeAt(double right, double down) {
  const std::pair<int, int> pixel = pixelAt(camera_, right, down);
  const GpuViewRenderer::Pixel drawn = renderer_->pixelAt(pixel.first, pixel.second);
  return unprojectPixel(camera_, pose_, pixel, drawn.depth, drawn.opacity);
}

FrameSource::Facts GpuFrameSource::facts() const {
  const SceneState state = renderer_->state();
  constexpr double kMiB = 1048576;
  Facts facts = {
      {"Drawn by", renderer_->device()},
      {"Image", fmt::format("{} x {}", camera_.width, camera_.height)},
      {"Contents drawn", fmt::format("{}", state.drawn)},
      {"In memory", fmt::format("{:.1f} of {:.0f} MiB", static_cast<double>(state.cache.bytes) / kMiB,
                                static_cast<double>(state.budgetBytes) / kMiB)},
      {"Loaded, dropped", fmt::format("{}, {}", state.cache.loads, state.cache.evictions)},
  };
  if (state.missing > 0) facts.emplace_back("Still to come", fmt::format("{}", state.missing));
  if (state.refused > 0) facts.emplace_back("No memory for", fmt::format("{}", state.refused));
  return facts;
}

}  // namespace tessera
