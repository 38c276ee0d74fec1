#include "apps/viewer/worker_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <utility>

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kLook = std::chrono::milliseconds(500);  // between two questions whether there is something new
constexpr double kBandSeconds = 0.1;                    // drawn before one looks whether another view is wanted
constexpr std::array kFiner = {0.25, 0.5, 1.0};         // of the window's pixels along an edge, one after another

double secondsSince(Clock::time_point begun) {
  return std::chrono::duration<double>(Clock::now() - begun).count();
}

// Rows [first, first + count) of a camera's picture.
Camera bandOf(const Camera& camera, int first, int count) {
  Camera band = camera;
  band.height = count;
  band.parameters[3] -= first;  // of a pinhole: the centre's y
  return band;
}

}  // namespace

WorkerPictures::WorkerPictures(const std::shared_ptr<const GpuContext>& context,
                               std::unique_ptr<ChangingRenderer> drawn)
    : stream_(std::make_shared<GpuStream>(context)),
      drawn_(std::move(drawn)),
      facts_(drawn_->facts()),
      background_(drawn_->renderer().background()),
      thread_([this] { work(); }) {}

WorkerPictures::~WorkerPictures() {
  {
    const std::lock_guard lock(mutex_);
    ends_ = true;
  }
  changed_.notify_all();
  thread_.join();
  stream_->context()->waitIdle();
}

void WorkerPictures::work() {
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

bool WorkerPictures::isOutdated(const Request& request) {
  const std::lock_guard lock(mutex_);
  return ends_ || request_ != request;
}

void WorkerPictures::drawFor(const Request& request) {
  const double share = pace_.share();
  const Clock::time_point begun = Clock::now();
  const Camera few = inPixels(request.window, share);
  hand(drawn_->renderer().render(few, request.worldFromCamera), request, share == 1);
  const double seconds = secondsSince(begun);
  pace_.took(1000 * seconds);
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

std::optional<RenderedView> WorkerPictures::drawInBands(const Camera& camera, const Request& request) {
  RenderedView all{ImageF(camera.width, camera.height, 3), ImageF(camera.width, camera.height, 1),
                   ImageF(camera.width, camera.height, 1)};
  for (int first = 0; first < camera.height;) {
    if (isOutdated(request)) return std::nullopt;
    const double rows = std::clamp(kBandSeconds / (secondsOfPixel_ * camera.width), 1.0, 1e6);
    const int count = std::min(static_cast<int>(rows), camera.height - first);
    const Clock::time_point begun = Clock::now();
    const RenderedView band = drawn_->renderer().render(bandOf(camera, first, count), request.worldFromCamera);
    secondsOfPixel_ = std::max(1e-9, secondsSince(begun) / (static_cast<double>(camera.width) * count));
    const size_t at = static_cast<size_t>(first) * static_cast<size_t>(camera.width);
    std::copy(band.colour.pixels.begin(), band.colour.pixels.end(), all.colour.pixels.begin() + 3 * at);
    std::copy(band.opacity.pixels.begin(), band.opacity.pixels.end(), all.opacity.pixels.begin() + at);
    std::copy(band.depth.pixels.begin(), band.depth.pixels.end(), all.depth.pixels.begin() + at);
    first += count;
  }
  return all;
}

void WorkerPictures::hand(RenderedView view, const Request& request, bool isWhole) {
  Facts facts = drawn_->facts();
  const std::lock_guard lock(mutex_);
  made_ = Made{std::move(view), request, isWhole};
  facts_ = std::move(facts);
  background_ = drawn_->renderer().background();
}

ShownPicture WorkerPictures::update(const Camera& window, const Pose& worldFromCamera, bool moving) {
  const Request request{window, worldFromCamera, moving};
  std::optional<Made> made;
  bool isNewView = false;
  {
    const std::lock_guard lock(mutex_);
    if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    isNewView = request_ != request;
    request_ = request;
    made = std::exchange(made_, std::nullopt);
  }
  if (isNewView) {
    changed_.notify_all();
    shown_.isWhole = false;
  }
  shown_.isNew = made.has_value();
  if (!made) return shown_;
  view_ = std::move(*made);
  const ImageF& picture = view_.view.colour;
  const auto colour = std::as_bytes(std::span(picture.pixels));
  const auto opacity = std::as_bytes(std::span(view_.view.opacity.pixels));
  if (pixels_.bytes() < colour.size() + opacity.size()) {
    stream_->retire(std::move(pixels_));
    pixels_ = GpuBuffer(stream_->context(), colour.size() + opacity.size());
  }
  stream_->upload(pixels_, 0, colour);
  stream_->upload(pixels_, colour.size(), opacity);
  stream_->send();
  shown_.onCard = {picture.width, picture.height, pixels_.address(), pixels_.address() + colour.size()};
  shown_.isWhole = view_.isWhole && !moving && view_.of == request;
  return shown_;
}

std::optional<Vec3d> WorkerPictures::placeAt(double right, double down) {
  const RenderedView& view = view_.view;
  if (view.depth.pixels.empty()) return std::nullopt;
  const Camera camera = view_.of.window.scaledTo(view.depth.width, view.depth.height);
  const std::pair<int, int> pixel = pixelAt(camera, right, down);
  const size_t row = static_cast<size_t>(pixel.second) * static_cast<size_t>(camera.width);
  const size_t at = row + static_cast<size_t>(pixel.first);
  return placeOf(camera, view_.of.worldFromCamera, pixel, view.depth.pixels[at], view.opacity.pixels[at]);
}

PictureSource::Facts WorkerPictures::facts() const {
  const std::lock_guard lock(mutex_);
  Facts facts = facts_;
  facts.emplace_back("Picture", fmt::format("{} x {}", view_.view.colour.width, view_.view.colour.height));
  return facts;
}

}  // namespace tessera
