#include "apps/tessera/warning_renderer.h"

#include <utility>

#include "base/log.h"

namespace tessera {
namespace {

class WarningRenderer final : public ViewRenderer {
 public:
  WarningRenderer(const fs::path& place, uint64_t budgetBytes, bool showsOutside,
                  std::unique_ptr<ViewRenderer> renderer, std::function<size_t()> countRefused)
      : place_(place),
        budgetBytes_(budgetBytes),
        showsOutside_(showsOutside),
        renderer_(std::move(renderer)),
        countRefused_(std::move(countRefused)) {}

  RenderedView render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) override {
    RenderedView view = renderer_->render(camera, worldFromCamera, opaqueDepth);
    if (countRefused_() > 0 && !std::exchange(warned_, true)) {
      warn("{}: views do not fit into {:.4g} MiB at their finest level and are rendered coarser; raise --memory-mib",
           place_.string(), static_cast<double>(budgetBytes_) / 1048576);
    }
    return view;
  }
  std::string whyNotThrough(const Camera& camera) const override { return renderer_->whyNotThrough(camera); }
  std::string device() const override { return renderer_->device(); }
  Eigen::Array3f background() const override { return renderer_->background(); }
  bool showsOutside() const override { return showsOutside_; }

 private:
  fs::path place_;
  uint64_t budgetBytes_;
  bool showsOutside_;
  std::unique_ptr<ViewRenderer> renderer_;
  std::function<size_t()> countRefused_;
  bool warned_ = false;
};

}  // namespace

std::unique_ptr<ViewRenderer> withWarnings(const fs::path& place, uint64_t budgetBytes, bool showsOutside,
                                           std::unique_ptr<ViewRenderer> renderer,
                                           std::function<size_t()> countRefused) {
  return std::make_unique<WarningRenderer>(place, budgetBytes, showsOutside, std::move(renderer),
                                           std::move(countRefused));
}

}  // namespace tessera
