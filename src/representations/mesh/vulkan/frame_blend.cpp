#include "representations/mesh/vulkan/frame_blend.h"

#include <utility>

#include "shaders/blend_frames.h"
#include "shaders/representations/mesh/arguments_mesh.h"
#include "shaders/show_blended.h"

namespace tessera {
namespace {

constexpr size_t kNumbersOfPixel = 5;
constexpr float kSmallestWeight = 0.04f;  // as in Unreal Engine: the mean of about 25 frames

}  // namespace

FrameBlend::FrameBlend(std::shared_ptr<GpuStream> stream)
    : stream_(std::move(stream)),
      blend_(stream_->context(), kBlendFramesSpirv),
      show_(stream_->context(), kShowBlendedSpirv) {}

FrameBlend::~FrameBlend() {
  for (GpuBuffer& history : histories_)
    if (history) stream_->deferDestroy(std::move(history));
}

void FrameBlend::ensureCapacity(const Camera& camera) {
  const size_t bytes = static_cast<size_t>(camera.width) * camera.height * kNumbersOfPixel * sizeof(float);
  for (GpuBuffer& history : histories_) {
    if (history.bytes() >= bytes) continue;
    if (history) stream_->deferDestroy(std::move(history));
    history = GpuBuffer();
    history = stream_->makeBuffer(bytes);
    frames_ = 0;
  }
}

void FrameBlend::blend(GpuFrame& frame, const Camera& camera, const Pose& worldFromCamera, bool isChanged,
                       uint64_t noise) {
  ensureCapacity(camera);
  const bool isSame = camera == camera_ && worldFromCamera.rotation == worldFromCamera_.rotation &&
                      worldFromCamera.translation == worldFromCamera_.translation && !isChanged;
  const bool canReproject = camera.width == camera_.width && camera.height == camera_.height &&
                            isPinhole(camera.lens) && isPinhole(camera_.lens);
  if (!isSame && !canReproject) frames_ = 0;
  std::swap(histories_[0], histories_[1]);
  arguments::BlendFramesArguments blending = {};
  blending.view = frame.view();
  if (frames_ > 0) blending.history = histories_[0].address();
  blending.blended = histories_[1].address();
  const Mat3d previousFromCamera = worldFromCamera_.rotation.transpose() * worldFromCamera.rotation;
  const Vec3d shift =
      worldFromCamera_.rotation.transpose() * (worldFromCamera.translation - worldFromCamera_.translation);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      blending.previousFromCamera[3 * row + column] = static_cast<float>(previousFromCamera(row, column));
    blending.shift[row] = static_cast<float>(shift[row]);
  }
  blending.focal[0] = static_cast<float>(camera_.focalX());
  blending.focal[1] = static_cast<float>(camera_.focalY());
  blending.centre[0] = static_cast<float>(camera_.centreX());
  blending.centre[1] = static_cast<float>(camera_.centreY());
  blending.noise = noise;
  blending.restingFrames = isSame ? atRest_ : 0;
  blending.smallestWeight = kSmallestWeight;
  frame.run(blend_, blending);
  frame.run(show_, blending);
  atRest_ = isSame && frames_ > 0 ? atRest_ + 1 : 1;
  ++frames_;
  camera_ = camera;
  worldFromCamera_ = worldFromCamera;
}

}  // namespace tessera
