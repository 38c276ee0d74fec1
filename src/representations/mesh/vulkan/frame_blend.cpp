#include "representations/mesh/vulkan/frame_blend.h"

#include <utility>

#include "shaders/blend_frames.h"
#include "shaders/representations/mesh/arguments_mesh.h"
#include "shaders/show_blended.h"

namespace tessera {
namespace {

constexpr size_t kNumbersOfPixel = 5;
// Measured (docs/benchmarks.md): a smaller weight, such as the 0.04 of Unreal Engine, removes more noise, but each
// frame resamples the history, whose error exceeds that noise after a few frames.
constexpr float kSmallestWeight = 0.6f;
constexpr float kLargestDeviation = 1;  // of the history from the mean around the pixel, in standard deviations
constexpr double kCosineOfCut = 0.96;   // a camera that turns by more than 16° between frames has jumped

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

bool FrameBlend::isResting(const Camera& camera, const Pose& worldFromCamera, bool isChanged) const {
  return frames_ > 0 && !isChanged && camera == camera_ && worldFromCamera.rotation == worldFromCamera_.rotation &&
         worldFromCamera.translation == worldFromCamera_.translation;
}

void FrameBlend::blend(GpuFrame& frame, const Camera& camera, const Pose& worldFromCamera, bool isChanged,
                       uint64_t noise) {
  ensureCapacity(camera);
  const bool isSame = isResting(camera, worldFromCamera, isChanged);
  const bool canReproject = camera.width == camera_.width && camera.height == camera_.height &&
                            isPinhole(camera.lens) && isPinhole(camera_.lens);
  std::swap(histories_[0], histories_[1]);
  arguments::BlendFramesArguments blending = {};
  blending.view = frame.view();
  blending.blended = histories_[1].address();
  const Mat3d previousFromCamera = worldFromCamera_.rotation.transpose() * worldFromCamera.rotation;
  const bool isCut = previousFromCamera.trace() < 1 + 2 * kCosineOfCut;
  if (!isSame && (!canReproject || isCut)) frames_ = 0;
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
  if (frames_ > 0) blending.history = histories_[0].address();
  blending.noise = noise;
  blending.restingFrames = isSame ? atRest_ : 0;
  blending.smallestWeight = kSmallestWeight;
  blending.largestDeviation = kLargestDeviation;
  frame.run(blend_, blending);
  frame.run(show_, blending);
  atRest_ = isSame ? atRest_ + 1 : 1;
  ++frames_;
  camera_ = camera;
  worldFromCamera_ = worldFromCamera;
}

}  // namespace tessera
