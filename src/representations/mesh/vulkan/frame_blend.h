// Temporal anti-aliasing: blends each frame with the frames before it.
#pragma once

#include "gpu/kernel.h"
#include "render/vulkan/gpu_frame.h"

namespace tessera {

class FrameBlend {
 public:
  explicit FrameBlend(std::shared_ptr<GpuStream> stream);
  ~FrameBlend();
  FrameBlend(const FrameBlend&) = delete;
  FrameBlend& operator=(const FrameBlend&) = delete;

  // Whether the view is that of the last frame. `isChanged`: as in blend().
  bool isResting(const Camera& camera, const Pose& worldFromCamera, bool isChanged) const;
  // Replaces the image of a frame by its blend with those before it. `isChanged`: whether another image is to be
  // expected of the same view, because contents have changed. Reprojects pinhole cameras only; others begin anew.
  // `noise`: address of BlendFramesArguments::noise, or 0.
  void blend(GpuFrame& frame, const Camera& camera, const Pose& worldFromCamera, bool isChanged, uint64_t noise);
  // Forgets the frames so far.
  void forget() { frames_ = 0; }
  // The number of frames of the same view of which the last image is the mean.
  uint32_t framesAtRest() const { return atRest_; }

 private:
  void ensureCapacity(const Camera& camera);

  std::shared_ptr<GpuStream> stream_;
  GpuKernel blend_, show_;
  std::array<GpuBuffer, 2> histories_;  // in turn
  uint32_t frames_ = 0, atRest_ = 0;
  Camera camera_;  // of the last frame
  Pose worldFromCamera_;
};

}  // namespace tessera
