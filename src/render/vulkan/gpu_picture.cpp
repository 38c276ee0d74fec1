#include "render/vulkan/gpu_picture.h"

#include <algorithm>

#include "shaders/begin_view.h"

namespace tessera {

namespace {

constexpr uint32_t kPixelsOfGroup = 8;  // local_size of the kernels, along an edge
constexpr size_t kNumbersDrawn = 5;     // of a pixel: colour, opacity, depth

void copy(const Vec3d& from, float* to) {
  for (int a = 0; a < 3; ++a) to[a] = static_cast<float>(from[a]);
}

}  // namespace

GpuPicture::GpuPicture(std::shared_ptr<GpuStream> stream)
    : stream_(std::move(stream)), begin_(stream_->context(), kBeginViewSpirv), pool_(0) {}

void GpuPicture::makeRoom(const Camera& camera, uint32_t numbersOfPixel) {
  pixels_.update(camera, pool_);
  if (directions_ && camera == camera_ && numbersOfPixel <= numbersOfPixel_) return;
  camera_ = camera;
  numbersOfPixel_ = numbersOfPixel;
  const size_t pixels = static_cast<size_t>(camera.width) * camera.height;
  for (GpuBuffer* buffer : {&directions_, &opaqueDepth_, &state_, &drawn_}) {
    stream_->retire(std::move(*buffer));
    *buffer = GpuBuffer();
  }
  directions_ = GpuBuffer(stream_->context(), pixels * 3 * sizeof(float));
  opaqueDepth_ = GpuBuffer(stream_->context(), pixels * sizeof(float));
  state_ = GpuBuffer(stream_->context(), pixels * numbersOfPixel * sizeof(float));
  drawn_ = GpuBuffer(stream_->context(), pixels * kNumbersDrawn * sizeof(float));
  std::vector<float> directions;
  directions.reserve(3 * pixels);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const Vec3f& direction = pixels_.at(x, y);
      directions.insert(directions.end(), direction.data(), direction.data() + 3);
    }
  }
  stream_->upload(directions_, 0, std::as_bytes(std::span(directions)));
}

void GpuPicture::begin(const TileFrame& frame, float minTransmittance, uint32_t numbersOfPixel, const Camera& camera,
                       const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  makeRoom(camera, numbersOfPixel);
  const size_t pixels = static_cast<size_t>(camera.width) * camera.height;
  view_ = {};
  const Mat3d sceneFromCamera = frame.rotation.transpose() * worldFromCamera.rotation;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      view_.sceneFromCamera[3 * row + column] = static_cast<float>(sceneFromCamera(row, column));
    }
  }
  copy(frame.inScene(worldFromCamera.translation), view_.origin);
  copy(frame.low, view_.low);
  copy(frame.high, view_.high);
  view_.near = static_cast<float>(frame.near);
  view_.scale = static_cast<float>(frame.scale);
  view_.minTransmittance = minTransmittance;
  view_.width = camera.width;
  view_.height = camera.height;
  view_.numbersOfPixel = numbersOfPixel;
  view_.directions = directions_.address();
  if (opaqueDepth != nullptr) {
    CHECK(opaqueDepth->pixels.size() == pixels);
    stream_->upload(opaqueDepth_, 0, std::as_bytes(std::span(opaqueDepth->pixels)));
    view_.opaqueDepth = opaqueDepth_.address();
  }
  view_.pixels = state_.address();
  view_.colour = drawn_.address();
  view_.opacity = view_.colour + 3 * pixels * sizeof(float);
  view_.depth = view_.opacity + pixels * sizeof(float);
  groups_ = {(view_.width + kPixelsOfGroup - 1) / kPixelsOfGroup, (view_.height + kPixelsOfGroup - 1) / kPixelsOfGroup};
  run(begin_, view_);
}

DrawnOnCard GpuPicture::onCard() const {
  return {camera_.width, camera_.height, view_.colour, view_.opacity, view_.depth};
}

RenderedView GpuPicture::drawn() {
  const int width = camera_.width, height = camera_.height;
  RenderedView made{ImageF(width, height, 3), ImageF(width, height, 1), ImageF(width, height, 1)};
  size_t offset = 0;
  for (ImageF* image : {&made.colour, &made.opacity, &made.depth}) {
    const auto bytes = std::as_writable_bytes(std::span(image->pixels));
    stream_->download(drawn_, offset, bytes);
    offset += bytes.size();
  }
  return made;
}

std::optional<double> GpuPicture::depthAt(double right, double down) {
  if (!drawn_) return std::nullopt;
  const size_t pixels = static_cast<size_t>(camera_.width) * camera_.height;
  const size_t x = static_cast<size_t>(std::clamp(right, 0.0, 1.0) * (camera_.width - 1) + 0.5);
  const size_t y = static_cast<size_t>(std::clamp(down, 0.0, 1.0) * (camera_.height - 1) + 0.5);
  const size_t pixel = y * static_cast<size_t>(camera_.width) + x;
  const auto numberAt = [&](size_t index) {
    float number = 0;
    stream_->download(drawn_, index * sizeof(float), std::as_writable_bytes(std::span(&number, 1)));
    return number;
  };
  const float opacity = numberAt(3 * pixels + pixel), depth = numberAt(4 * pixels + pixel);
  if (opacity < 0.5f) return std::nullopt;
  return depth / opacity;
}

}  // namespace tessera
