#include "apps/viewer/worker_pictures.h"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <utility>

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kLook = std::chrono::milliseconds(500);  // between two questions whether there is something new
constexpr int kBandPixels = 1 << 15;                    // drawn before one looks whether another view is wanted
constexpr std::array kFiner = {0.25, 0.5, 1.0};         // of the window's pixels along an edge, one after another

double milliseconds(Clock::time_point since) {
  return std::chrono::duration<double, std::milli>(Clock::now() - since).count();
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
      isRefreshed();
      if (done_ != request) drawFor(request);
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
  }
}

bool WorkerPictures::isRefreshed() {
  const Clock::time_point now = Clock::now();
  if (now - looked_ < kLook) return false;
  looked_ = now;
  if (!drawn_->refresh()) return false;
  done_.reset();
  return true;
}

bool WorkerPictures::isOutdated(const Request& request) {
  const std::lock_guard lock(mutex_);
  return ends_ || request_ != request;
}

void WorkerPictures::drawFor(const Request& request) {
  const Clock::time_point begun = Clock::now();
  const double share = pace_.share();
  hand(drawn_->renderer().render(inPixels(request.window, share), request.worldFromCamera), request, share == 1);
  pace_.took(milliseconds(begun));
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
  const int rows = std::max(1, kBandPixels / camera.width);
  for (int first = 0; first < camera.height; first += rows) {
    if (isOutdated(request) || isRefreshed()) return std::nullopt;
    const int count = std::min(rows, camera.height - first);
    const RenderedView band = drawn_->renderer().render(bandOf(camera, first, count), request.worldFromCamera);
    const size_t at = static_cast<size_t>(first) * static_cast<size_t>(camera.width);
    std::copy(band.colour.pixels.begin(), band.colour.pixels.end(), all.colour.pixels.begin() + 3 * at);
    std::copy(band.opacity.pixels.begin(), band.opacity.pixels.end(), all.opacity.pixels.begin() + at);
    std::copy(band.depth.pixels.begin(), band.depth.pixels.end(), all.depth.pixels.begin() + at);
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
  view_ = std::move(made->view);
  const auto colour = std::as_bytes(std::span(view_.colour.pixels));
  const auto opacity = std::as_bytes(std::span(view_.opacity.pixels));
  if (pixels_.bytes() < colour.size() + opacity.size()) {
    stream_->retire(std::move(pixels_));
    pixels_ = GpuBuffer(stream_->context(), colour.size() + opacity.size());
  }
  stream_->upload(pixels_, 0, colour);
  stream_->upload(pixels_, colour.size(), opacity);
  stream_->send();
  shown_.onCard = {view_.colour.width, view_.colour.height, pixels_.address(), pixels_.address() + colour.size(), 0};
  shown_.isWhole = made->isWhole && !moving && made->of == request;
  return shown_;
}

std::optional<double> WorkerPictures::depthAt(double right, double down) {
  const ImageF& depth = view_.depth;
  if (depth.pixels.empty()) return std::nullopt;
  const int x = static_cast<int>(std::clamp(right, 0.0, 1.0) * (depth.width - 1) + 0.5);
  const int y = static_cast<int>(std::clamp(down, 0.0, 1.0) * (depth.height - 1) + 0.5);
  const size_t pixel = static_cast<size_t>(y) * static_cast<size_t>(depth.width) + static_cast<size_t>(x);
  const float opacity = view_.opacity.pixels[pixel];
  if (opacity < 0.5f) return std::nullopt;
  return depth.pixels[pixel] / opacity;
}

PictureSource::Facts WorkerPictures::facts() const {
  const std::lock_guard lock(mutex_);
  Facts facts = facts_;
  facts.emplace_back("Picture", fmt::format("{} x {}", view_.colour.width, view_.colour.height));
  return facts;
}

}  // namespace tessera
