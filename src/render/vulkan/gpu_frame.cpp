#include "render/vulkan/gpu_frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "shaders/begin_view.h"

namespace tessera {

namespace {

constexpr uint32_t kPixelsOfGroup = 8;  // local_size of the kernels along an axis
constexpr size_t kNumbersDrawn = 5;     // per pixel: colour, opacity, depth

void copy(const Vec3d& from, float* to) {
  for (int a = 0; a < 3; ++a) to[a] = static_cast<float>(from[a]);
}

}  // namespace

GpuFrame::GpuFrame(std::shared_ptr<GpuStream> stream)
    : stream_(std::move(stream)), begin_(stream_->context(), kBeginViewSpirv), pool_(0) {}

void GpuFrame::ensureCapacity(GpuBuffer& buffer, size_t floats) {
  if (buffer.bytes() >= floats * sizeof(float)) return;
  stream_->deferDestroy(std::move(buffer));
  buffer = GpuBuffer();
  buffer = stream_->makeBuffer(floats * sizeof(float));
}

void GpuFrame::ensureCapacity(const Camera& camera, uint32_t numbersOfPixel) {
  pixels_.update(camera, pool_);
  const size_t pixels = static_cast<size_t>(camera.width) * camera.height;
  constexpr size_t kMax = std::numeric_limits<int32_t>::max();  // drivers take indices as signed
  if (pixels * std::max<size_t>(numbersOfPixel, kNumbersDrawn) > kMax) {
    throw Error(fmt::format("image of {}x{}", camera.width, camera.height), "", "is too large for a GPU",
                "ask for a smaller one, or use --device cpu");
  }
  ensureCapacity(directions_, pixels * 3);
  ensureCapacity(opaqueDepth_, pixels);
  ensureCapacity(state_, pixels * numbersOfPixel);
  ensureCapacity(drawn_, pixels * kNumbersDrawn);
  if (camera == camera_) return;
  camera_ = camera;
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

void GpuFrame::applySurroundings() {
  const size_t pixels = size_t{view_.width} * view_.height;
  if (surroundings_.opaqueDepth != 0) view_.opaqueDepth = surroundings_.opaqueDepth;
  if (surroundings_.wantsSurface) {
    ensureCapacity(surface_, pixels);
    view_.surface = surface_.address();
  }
  std::vector<float> boxes;
  for (const auto* some : {&surroundings_.hidden, &surroundings_.hiddenOfBackgroundBlock}) {
    for (const Mat4d& box : *some) {
      for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 4; ++column) boxes.push_back(static_cast<float>(box(row, column)));
    }
  }
  if (boxes.empty()) return;
  ensureCapacity(boxes_, boxes.size());
  stream_->upload(boxes_, 0, std::as_bytes(std::span(boxes)));
  view_.boxes = boxes_.address();
  view_.boxCount = static_cast<uint32_t>(boxes.size() / 12);
  view_.boxesOfAll = static_cast<uint32_t>(surroundings_.hidden.size());
}

void GpuFrame::begin(const TileFrame& frame, float minTransmittance, uint32_t numbersOfPixel,
                     const ViewRequest& request) {
  const Camera& camera = request.camera;
  const Pose& worldFromCamera = request.worldFromCamera;
  const ImageF* opaqueDepth = request.opaqueDepth;
  ensureCapacity(camera, numbersOfPixel);
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
  applySurroundings();
  view_.pixels = state_.address();
  view_.colour = drawn_.address();
  view_.opacity = view_.colour + 3 * pixels * sizeof(float);
  view_.depth = view_.opacity + pixels * sizeof(float);
  groups_ = {(view_.width + kPixelsOfGroup - 1) / kPixelsOfGroup, (view_.height + kPixelsOfGroup - 1) / kPixelsOfGroup};
  run(begin_, view_);
}

GpuRenderedView GpuFrame::onGpu() const {
  return {camera_.width, camera_.height, view_.colour, view_.opacity, view_.surface};
}

RenderedView GpuFrame::drawn() {
  const int width = camera_.width, height = camera_.height;
  RenderedView rendered{ImageF(width, height, 3), ImageF(width, height, 1), ImageF(width, height, 1)};
  size_t offset = 0;
  for (ImageF* image : {&rendered.colour, &rendered.opacity, &rendered.depth}) {
    const auto bytes = std::as_writable_bytes(std::span(image->pixels));
    stream_->download(drawn_, offset, bytes);
    offset += bytes.size();
  }
  return rendered;
}

std::array<float, 2> GpuFrame::opacityAndDepthAt(int x, int y) {
  const size_t width = static_cast<size_t>(camera_.width), pixels = width * static_cast<size_t>(camera_.height);
  const size_t pixel = static_cast<size_t>(y) * width + static_cast<size_t>(x);
  CHECK(pixel < pixels);
  std::array<float, 2> read = {};
  const auto one = [&](size_t number, float& to) {
    return GpuStream::Download{&drawn_, (number * pixels + pixel) * sizeof(float),
                               std::as_writable_bytes(std::span(&to, 1))};
  };
  const GpuStream::Download downloads[] = {one(3, read[0]), one(4, read[1])};
  stream_->download(downloads);
  return read;
}

}  // namespace tessera
