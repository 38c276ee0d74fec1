#include "apps/tessera/model_source.h"

#include <utility>

#include "representations/methods.h"
#include "train/photo_exposures.h"

namespace tessera {
namespace {

class ModelRenderSource final : public RenderSource {
 public:
  ModelRenderSource(const fs::path& folder, std::unique_ptr<OpenedModel> model)
      : folder_(folder), model_(std::move(model)) {}

  ViewRenderer& renderer() override { return model_->renderer(); }
  Mat4d sourceFromWorld() const override { return folder_.readPlacement().sourceFromWorld; }
  void requireMatchingWorld(const Capture& capture) const override { requireSameWorld(folder_, capture); }
  std::vector<std::string> trainedOnAmong(const Capture& capture, Split split) const override {
    return tessera::trainedOnAmong(folder_, capture, split);
  }
  std::vector<SurfaceCoverage> coverage() const override {
    return readCoverage(findModelMethod(folder_), folder_.root());
  }
  std::optional<ExposureResponse> exposureResponse() const override { return readExposureResponse(folder_); }

 private:
  ModelFolder folder_;
  std::unique_ptr<OpenedModel> model_;
};

}  // namespace

std::unique_ptr<RenderSource> openModel(Device& device, const fs::path& folder) {
  return std::make_unique<ModelRenderSource>(folder, findModelMethod(ModelFolder(folder)).openModel(device, folder));
}

}  // namespace tessera
