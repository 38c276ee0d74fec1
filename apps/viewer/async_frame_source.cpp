#include "apps/viewer/async_frame_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kLook = std::chrono::milliseconds(500);  // interval of the checks for a newer version
constexpr double kBandSeconds = 0.1;                    // duration of a band, after which a new request is checked for
constexpr std::array kFiner = {0.25, 0.5, 1.0};         // successive fractions of the window's pixels along an edge

double secondsSince(Clock::time_point begun) {
  return std::chrono::duration<double>(Clock::now() - begun).count();
}

// Returns the camera of rows [first, first + count) of a camera's image.
Camera cropRows(const Camera& camera, int first, int count) {
  Camera band = camera;
  band.height = count;
  band.parameters[3] -= first;  // the y of the pinhole's principal point
  return band;
}

}  // namespace

AsyncFrameSource::AsyncFrameSource(const std::shared_ptr<const GpuContext>& context,
                                   std::unique_ptr<ChangingRenderer> drawn)
    : stream_(std::make_shared<GpuStream>(context)),
      drawn_(std::move(drawn)),
      facts_(drawn_->facts()),
      background_(drawn_->renderer().background()),
      thread_([this] { work(); }) {}

AsyncFrameSource::~AsyncFrameSource() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  changed_.notify_all();
  thread_.join();
  stream_->context()->waitIdle();
}

void AsyncFrameSource::work() {
  try {
    while (true) {
      Request request;
      {
        std::unique_lock lock(mutex_);
        changed_.wait_for(lock, kLook, [&] { return ends_ || (request_ && request_ != done_); });
        if (ends_) return;
        if (!request_) continue;
        request = *request_;
      }
      if (drawn_->refresh()) done_.reset();
      if (done_ != request) drawFor(request);
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
  }
}

bool AsyncFrameSource::isOutdated(const Request& request) {
  const std::lock_guard lock(mutex_);
  return ends_ || request_ != request;
}

void AsyncFrameSource::drawFor(const Request& request) {
  const double share = resolution_.share();
  const Clock::time_point begun = Clock::now();
  const Camera few = inPixels(request.window, share);
  hand(drawn_->renderer().render(few, request.worldFromCamera), request, share == 1);
  const double seconds = secondsSince(begun);
  resolution_.took(1000 * seconds);
  secondsOfPixel_ = seconds / (static_cast<double>(few.width) * few.height);
  if (!request.moving) {
    for (const double finer : kFiner) {
      if (finer <= share) continue;
      std::optional<RenderedView> view = drawInBands(inPixels(request.window, finer), request);
      if (!view) return;
      hand(std::move(*view), request, finer == 1);
    }
  }
  done_ = request;
}

std::optional<RenderedView> AsyncFrameSource::drawInBands(const Camera& camera, const Request& request) {
  RenderedView all{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                   ImageF(camera.width, camera.height, 1)};
  for (int first = 0; first < camera.height;) {
    if (isOutdated(request)) return std::nullopt;
    const double rows = std::clamp(kBandSeconds / (secondsOfPixel_ * camera.width), 1.0, 1e6);
    const int count = std::min(static_cast<int>(rows), camera.height - first);
    const Clock::time_point begun = Clock::now();
    const RenderedView band = drawn_->renderer().render(cropRows(camera, first, count), request.worldFromCamera);
    secondsOfPixel_ = std::max(1e-9, secondsSince(begun) / (static_cast<double>(camera.width) * count));
    const size_t at = static_cast<size_t>(first) * static_cast<size_t>(camera.width);
    std::copy(band.colour.pixels.begin(), band.colour.pixels.end(), all.colour.pixels.begin() + 3 * at);
    std::copy(band.opacity.pixels.begin(), band.opacity.pixels.end(), all.opacity.pixels.begin() + at);
    std::copy(band.depth.pixels.begin(), band.depth.pixels.end(), all.depth.pixels.begin() + at);
    first += count;
  }
  return all;
}

void AsyncFrameSource::hand(RenderedView view, const Request& request, bool isComplete) {
  Facts facts = drawn_->facts();
  const std::lock_guard lock(mutex_);
  made_ = Made{std::move(view), request, isComplete};
  facts_ = std::move(facts);
  background_ = drawn_->renderer().background();
}

ShownPicture AsyncFrameSource::update(const Camera& window, const Pose& worldFromCamera, bool moving) {
  const Request request{window, worldFromCamera, moving};
  std::optional<Made> newView;
  bool isNewView = false;
  {
    const std::lock_guard lock(mutex_);
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    isNewView = request_ != request;
    request_ = request;
    newView = std::exchange(made_, std::nullopt);
  }
  if (isNewView) {
    changed_.notify_all();
    shown_.isComplete = false;
  }
  shown_.isNew = newView.has_value();
  if (!newView) return shown_;
  view_ = std::move(*newView);
  const ImageF& picture = view_.view.colour;
  const auto colour = std::as_bytes(std::span(picture.pixels));
  const auto opacity = std::as_bytes(std::span(view_.view.opacity.pixels));
  if (pixels_.bytes() < colour.size() + opacity.size()) {
    stream_->deferDestroy(std::move(pixels_));
    pixels_ = GpuBuffer(stream_->context(), colour.size() + opacity.size());
  }
  stream_->upload(pixels_, 0, colour);
  stream_->upload(pixels_, colour.size(), opacity);
  stream_->send();
  shown_.onGpu = {picture.width, picture.height, pixels_.address(), pixels_.address() + colour.size()};
  shown_.isComplete = view_.isComplete && !moving && view_.of == request;
  return shown_;
}

std::optional<Vec3d> AsyncFrameSource::placeAt(double right, double down) {
  const RenderedView& view = view_.view;
  if (view.depth.pixels.empty()) return std::nullopt;
  const Camera camera = view_.of.window.scaledTo(view.depth.width, view.depth.height);
  const std::pair<int, int> pixel = pixelAt(camera, right, down);
  const size_t row = static_cast<size_t>(pixel.second) * static_cast<size_t>(camera.width);
  const size_t at = row + static_cast<size_t>(pixel.first);
  return unprojectPixel(camera, view_.of.worldFromCamera, pixel, view.depth.pixels[at], view.opacity.pixels[at]);
}

FrameSource::Facts AsyncFrameSource::facts() const {
  const std::lock_guard lock(mutex_);
  Facts facts = facts_;
  facts.emplace_back("Image", fmt::format("{} x {}", view_.view.colour.width, view_.view.colour.height));
  return facts;
}

}  // namespace tessera
