#include "apps/viewer/viewer.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>

#include "apps/viewer/interface.h"
#include "apps/viewer/panel.h"
#include "apps/viewer/window.h"
#include "base/error.h"
#include "base/image_io.h"
#include "gpu/presenter.h"
#include "shaders/show_picture.h"
#include "shaders/whole_window.h"
#include "shaders/window/arguments_window.h"

namespace tessera {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kRest = 0.3;   // seconds after the last motion, when the camera counts as resting
constexpr double kIdle = 0.1;   // seconds to wait for an event at rest
constexpr double kBusy = 0.01;  // seconds, while the image is being completed
constexpr int kSettling = 3;    // further frames, in which panels settle to their sizes

Camera makeWindowCamera(VkExtent2D window, double fieldOfView) {
  const double focal = 0.5 * window.height / std::tan(0.5 * fieldOfView * std::numbers::pi / 180);
  Camera camera;
  camera.width = static_cast<int>(window.width);
  camera.height = static_cast<int>(window.height);
  camera.parameters = {focal, focal, 0.5 * window.width, 0.5 * window.height};
  return camera;
}

// Returns the vertical field of view in degrees that shows a photo's full height in the window.
float computeFieldOfView(const Camera& camera) {
  const double angle = 2 * std::atan(0.5 * camera.height / camera.focalY()) * 180 / std::numbers::pi;
  return static_cast<float>(std::clamp(angle, 15.0, 110.0));
}

// The device that presents images in the window: the one that was requested, otherwise the best that can present.
struct Screen {
  std::shared_ptr<const GpuContext> context;
  std::unique_ptr<GpuPresenter> presenter;
};

Screen openScreen(const Window& window, const ViewOptions& view) {
  GpuOptions options;
  options.presents = true;
  const auto open = [&] {
    std::shared_ptr<const GpuContext> context = GpuContext::open(options);
    auto presenter = std::make_unique<GpuPresenter>(context, window.makeSurface(context->instance()));
    return Screen{std::move(context), std::move(presenter)};
  };
  options.device = parseVulkanDevice(view.device.kind).value_or("");
  if (view.device.kind.starts_with("vulkan:")) return open();
  try {
    return open();
  } catch (const Error&) {
    const size_t devices = GpuContext::devices().size();
    for (size_t device = 0; device < devices; ++device) {
      options.device = std::to_string(device);
      try {
        return open();
      } catch (const Error&) {  // the error of the best device is reported
      }
    }
    throw;
  }
}

std::string folderName(const fs::path& folder) {
  const fs::path whole = fs::absolute(folder).lexically_normal();
  return (whole.has_filename() ? whole : whole.parent_path()).filename().string();
}

class Viewer {
 public:
  // `world`: from readWorldToView; not needed afterwards.
  Viewer(const ViewOptions& view, const std::optional<WorldToView>& world, const WindowOptions& options)
      : options_(options),
        place_(loadPlace(view, world)),
        navigation_(place_.low, place_.high),
        name_(folderName(view.folder)),
        window_("tessera: " + name_, options.width, options.height),
        screen_(openScreen(window_, view)),
        pictures_(openPictures(view, world, screen_.context)),
        showPicture_(screen_.context, screen_.presenter->renderPass(), kWholeWindowSpirv, kShowPictureSpirv),
        interface_(window_, screen_.context, screen_.presenter->renderPass()) {
    navigation_.setMode(options.mode);
    navigation_.setLook(overview());
    panel_.isShown = options.panels;
    if (!options.from.empty()) begin(options.from);
    window_.show();
  }
  ~Viewer() { screen_.context->waitIdle(); }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;

  void run() {
    while (!window_.isClosing()) {
      window_.listen(isMoving() ? 0 : panel_.isComplete ? kIdle : kBusy);
      const VkExtent2D size = window_.pixels();
      if (size.width == 0 || size.height == 0) {
        window_.listen(kIdle);
        continue;
      }
      if (window_.takeTouched() || isMoving()) still_ = 0;
      if (still_ > kSettling) {
        if (!updatePicture(size).isNew) continue;  // the window already shows this image
        still_ = 0;
      }
      interface_.begin();
      move();
      const ShownPicture picture = updatePicture(size);
      still_ = picture.isNew ? 0 : still_ + 1;
      whole_ = picture.isComplete ? whole_ + 1 : 0;
      panel_.isComplete = picture.isComplete;
      count(picture);
      tell();
      interface_.end();
      GpuPresenter& presenter = *screen_.presenter;
      if (!presenter.begin(size)) {
        still_ = 0;
        continue;
      }
      show(picture);
      interface_.paint(presenter);
      const bool isTaken = !options_.screenshot.empty() && whole_ >= kSettling;
      ImageU8 taken;
      presenter.end(isTaken ? &taken : nullptr);
      if (isTaken) {
        writePng(options_.screenshot, taken);
        return;
      }
    }
  }

 private:
  ShownPicture updatePicture(VkExtent2D size) {
    return pictures_->update(makeWindowCamera(size, panel_.fieldOfView), navigation_.worldFromCamera(), isMoving());
  }

  // Begins at a photo, found by the end of its name, so that users need not type folders.
  void begin(const std::string& name) {
    for (size_t i = 0; i < place_.views.size(); ++i) {
      if (!place_.views[i].name.ends_with(name)) continue;
      panel_.view = static_cast<int>(i);
      panel_.fieldOfView = computeFieldOfView(place_.views[i].camera);
      navigation_.setLook(navigation_.lookFromPose(place_.views[i].worldFromCamera));
      return;
    }
    throw Error("--from " + name, "", "no photo's name ends with this",
                place_.views.empty() ? "name the capture with --views" : "the first is " + place_.views[0].name);
  }

  void go(int view) {
    const int count = static_cast<int>(place_.views.size());
    if (count == 0) return;
    panel_.view = (view + count) % count;
    const NamedView& to = place_.views[static_cast<size_t>(panel_.view)];
    panel_.fieldOfView = computeFieldOfView(to.camera);
    navigation_.flyTo(navigation_.lookFromPose(to.worldFromCamera));
  }

  Look overview() const {
    const VkExtent2D size = window_.pixels();
    return navigation_.overview(size.height > 0 ? static_cast<double>(size.width) / size.height : 1);
  }

  bool isMoving() const { return Clock::now() - lastMove_ < std::chrono::duration<double>(kRest); }

  void move() {
    for (const auto& [key, mode] :
         {std::pair(GLFW_KEY_1, NavigationMode::map), std::pair(GLFW_KEY_2, NavigationMode::orbit),
          std::pair(GLFW_KEY_3, NavigationMode::fly)}) {
      if (interface_.pressed(key)) navigation_.setMode(mode);
    }
    if (interface_.pressed(GLFW_KEY_F1)) panel_.isShown = !panel_.isShown;
    if (interface_.pressed(GLFW_KEY_H)) navigation_.flyTo(overview());
    if (interface_.pressed(GLFW_KEY_N)) go(panel_.view + 1);
    if (interface_.pressed(GLFW_KEY_B)) go(std::max(panel_.view, 0) - 1);
    if (const std::optional<Vec2d> place = interface_.doubleClick();
        place && navigation_.mode() != NavigationMode::fly) {
      if (const std::optional<Vec3d> seen = pictures_->placeAt(place->x(), place->y())) navigation_.focus(*seen);
    }
    Moves moves = interface_.moves();
    moves.viewHeight = 2 * std::tan(0.5 * panel_.fieldOfView * std::numbers::pi / 180);
    if (navigation_.update(moves)) lastMove_ = Clock::now();
  }

  // Measures the time between new images while the camera moves.
  void count(const ShownPicture& picture) {
    if (!picture.isNew) return;
    const Clock::time_point now = Clock::now();
    const double passed = std::chrono::duration<double, std::milli>(now - lastPicture_).count();
    const bool isFirst = panel_.milliseconds == 0;
    if (isMoving() && wasMoving_) panel_.milliseconds += (isFirst ? 1 : 0.1) * (passed - panel_.milliseconds);
    wasMoving_ = isMoving();
    lastPicture_ = now;
  }

  void tell() {
    if (!panel_.isShown) return;
    const float lens = panel_.fieldOfView;
    const PanelAction action = showPanel(name_, navigation_, place_.views, pictures_->facts(), panel_);
    if (panel_.fieldOfView != lens) lastMove_ = Clock::now();
    if (action.all) navigation_.flyTo(overview());
    if (action.view >= 0) go(action.view);
  }

  void show(const ShownPicture& picture) {
    if (picture.onGpu.colour == 0) return;
    arguments::ShowPictureArguments shown = {};
    shown.colour = picture.onGpu.colour;
    shown.opacity = picture.onGpu.opacity;
    shown.width = static_cast<uint32_t>(picture.onGpu.width);
    shown.height = static_cast<uint32_t>(picture.onGpu.height);
    const VkExtent2D size = screen_.presenter->extent();
    shown.windowWidth = static_cast<float>(size.width);
    shown.windowHeight = static_cast<float>(size.height);
    const Eigen::Array3f background = pictures_->background();
    std::copy(background.data(), background.data() + 3, shown.background);
    screen_.presenter->draw(showPicture_, std::as_bytes(std::span(&shown, 1)), 3, {{0, 0}, size});
  }

  WindowOptions options_;
  Place place_;
  Navigation navigation_;
  std::string name_;
  Window window_;
  Screen screen_;
  std::unique_ptr<FrameSource> pictures_;
  GpuScreenPipeline showPicture_;
  Interface interface_;
  PanelState panel_;
  Clock::time_point lastMove_, lastPicture_;
  bool wasMoving_ = false;  // at the last new image
  int still_ = 0;           // frames since anything changed
  int whole_ = 0;           // frames since the image became complete
};

}  // namespace

void runViewer(const ViewOptions& view, const WindowOptions& options) {
  requireViewable(view.folder);
  waitForModel(view.folder);
  Viewer viewer(view, readWorldToView(view), options);
  viewer.run();
}

}  // namespace tessera
