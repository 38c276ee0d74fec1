#include "apps/viewer/viewer.h"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <fmt/format.h>

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

constexpr double kRest = 0.3;   // seconds after the last motion: the camera rests
constexpr double kIdle = 0.1;   // seconds to wait for something to happen, at rest
constexpr double kBusy = 0.01;  // likewise, while the picture becomes whole
constexpr int kSettling = 3;    // pictures of the window after that: panels find their sizes

Camera cameraOf(VkExtent2D window, double fieldOfView) {
  const double focal = 0.5 * window.height / std::tan(0.5 * fieldOfView * std::numbers::pi / 180);
  Camera camera;
  camera.width = static_cast<int>(window.width);
  camera.height = static_cast<int>(window.height);
  camera.parameters = {focal, focal, 0.5 * window.width, 0.5 * window.height};
  return camera;
}

// The lens of a photo's camera, as a window shows it: its height fits.
float fieldOfViewOf(const Camera& camera) {
  const double angle = 2 * std::atan(0.5 * camera.height / camera.focalY()) * 180 / std::numbers::pi;
  return static_cast<float>(std::clamp(angle, 15.0, 110.0));
}

class Viewer {
 public:
  Viewer(const ViewOptions& view, const WindowOptions& options)
      : options_(options),
        place_(placeOf(view)),
        navigation_(place_.low, place_.high),
        name_(fs::absolute(view.folder).lexically_normal().filename().string()),
        window_("tessera: " + name_, options.width, options.height),
        context_(GpuContext::open(windowDevice(view))),
        presenter_(context_, window_.makeSurface(context_->instance())),
        showPicture_(context_, presenter_.renderPass(), kWholeWindowSpirv, kShowPictureSpirv),
        interface_(window_, context_, presenter_.renderPass()),
        pictures_(openPictures(view, context_)) {
    navigation_.setMode(options.mode);
    panel_.isShown = options.panels;
    if (!options.from.empty()) begin(options.from);
  }

  void run() {
    while (!window_.isClosing()) {
      window_.listen(isMoving() ? 0 : panel_.isWhole ? kIdle : kBusy);
      const VkExtent2D size = window_.pixels();
      if (size.width == 0 || size.height == 0) {
        window_.listen(kIdle);
        continue;
      }
      if (window_.takeTouched() || isMoving()) rested_ = 0;
      if (rested_ > kSettling && !pictureOf(size).isNew) continue;  // all is shown as it is
      interface_.begin();
      move();
      const ShownPicture picture = pictureOf(size);
      panel_.isWhole = picture.isWhole;
      count(picture);
      rested_ = picture.isWhole ? rested_ + 1 : 0;
      tell();
      interface_.end();
      if (!presenter_.begin(size)) {
        rested_ = 0;
        continue;
      }
      show(picture);
      interface_.paint(presenter_);
      const bool isTaken = !options_.screenshot.empty() && rested_ == kSettling;
      ImageU8 taken;
      presenter_.end(isTaken ? &taken : nullptr);
      if (isTaken) {
        writePng(options_.screenshot, taken);
        return;
      }
    }
  }

 private:
  // By the end of a name, so that nobody has to write folders.
  void begin(const std::string& name) {
    for (size_t i = 0; i < place_.views.size(); ++i) {
      if (!place_.views[i].name.ends_with(name)) continue;
      panel_.view = static_cast<int>(i);
      panel_.fieldOfView = fieldOfViewOf(place_.views[i].camera);
      navigation_.setLook(navigation_.lookOf(place_.views[i].worldFromCamera));
      return;
    }
    throw Error("--from " + name, "", "no photo has a name that ends so",
                place_.views.empty() ? "name the capture with --views" : "the first is " + place_.views[0].name);
  }

  void go(int view) {
    const int count = static_cast<int>(place_.views.size());
    if (count == 0) return;
    panel_.view = (view + count) % count;
    const NamedView& to = place_.views[static_cast<size_t>(panel_.view)];
    panel_.fieldOfView = fieldOfViewOf(to.camera);
    navigation_.flyTo(navigation_.lookOf(to.worldFromCamera));
  }

  ShownPicture pictureOf(VkExtent2D size) {
    return pictures_->update(cameraOf(size, panel_.fieldOfView), navigation_.worldFromCamera(), isMoving());
  }

  bool isMoving() const { return Clock::now() - lastMove_ < std::chrono::duration<double>(kRest); }

  void move() {
    for (const auto& [key, mode] :
         {std::pair(GLFW_KEY_1, NavigationMode::map), std::pair(GLFW_KEY_2, NavigationMode::orbit),
          std::pair(GLFW_KEY_3, NavigationMode::fly)}) {
      if (interface_.pressed(key)) navigation_.setMode(mode);
    }
    if (interface_.pressed(GLFW_KEY_F1)) panel_.isShown = !panel_.isShown;
    if (interface_.pressed(GLFW_KEY_H)) navigation_.flyTo(navigation_.overview());
    if (interface_.pressed(GLFW_KEY_N)) go(panel_.view + 1);
    if (interface_.pressed(GLFW_KEY_B)) go(std::max(panel_.view, 0) - 1);
    if (const std::optional<Vec2d> place = interface_.doubleClick();
        place && navigation_.mode() != NavigationMode::fly) {
      focus(*place);
    }
    if (navigation_.update(interface_.moves())) lastMove_ = Clock::now();
  }

  // How fast pictures come while the camera moves.
  void count(const ShownPicture& picture) {
    if (!picture.isNew) return;
    const Clock::time_point now = Clock::now();
    const double passed = std::chrono::duration<double, std::milli>(now - lastPicture_).count();
    const bool isFirst = panel_.milliseconds == 0;
    if (isMoving() && wasMoving_) panel_.milliseconds += (isFirst ? 1 : 0.1) * (passed - panel_.milliseconds);
    wasMoving_ = isMoving();
    lastPicture_ = now;
  }

  // Nearer to what is seen there.
  void focus(const Vec2d& place) {
    const std::optional<double> depth = pictures_->depthAt(place.x(), place.y());
    if (!depth) return;
    const Camera camera = cameraOf(window_.pixels(), panel_.fieldOfView);
    const std::optional<Vec3d> direction =
        camera.directionInCamera({place.x() * camera.width, place.y() * camera.height});
    navigation_.focus(navigation_.worldFromCamera() * (*direction / direction->z() * *depth));
  }

  void tell() {
    if (!panel_.isShown) return;
    const PanelWish wish = showPanel(name_, navigation_, place_.views, pictures_->facts(), panel_);
    if (wish.all) navigation_.flyTo(navigation_.overview());
    if (wish.view >= 0) go(wish.view);
  }

  void show(const ShownPicture& picture) {
    if (picture.onCard.colour == 0) return;
    arguments::ShowPictureArguments shown = {};
    shown.colour = picture.onCard.colour;
    shown.opacity = picture.onCard.opacity;
    shown.width = static_cast<uint32_t>(picture.onCard.width);
    shown.height = static_cast<uint32_t>(picture.onCard.height);
    const VkExtent2D size = presenter_.extent();
    shown.windowWidth = static_cast<float>(size.width);
    shown.windowHeight = static_cast<float>(size.height);
    const Eigen::Array3f background = pictures_->background();
    std::copy(background.data(), background.data() + 3, shown.background);
    presenter_.draw(showPicture_, std::as_bytes(std::span(&shown, 1)), 3, {{0, 0}, size});
  }

  WindowOptions options_;
  Place place_;
  Navigation navigation_;
  std::string name_;
  Window window_;
  std::shared_ptr<const GpuContext> context_;
  GpuPresenter presenter_;
  GpuScreenPipeline showPicture_;
  Interface interface_;
  std::unique_ptr<PictureSource> pictures_;
  PanelState panel_;
  Clock::time_point lastMove_, lastPicture_;
  bool wasMoving_ = false;  // at the last new picture
  int rested_ = 0;          // pictures of the window since all was shown
};

}  // namespace

void runViewer(const ViewOptions& view, const WindowOptions& options) {
  requireViewable(view.folder);
  Viewer(view, options).run();
}

}  // namespace tessera
