#include "apps/tessera/drawable.h"

#include <algorithm>
#include <utility>

#include "apps/tessera/scene_source.h"
#include "base/error.h"
#include "representations/field/field_renderer.h"
#include "representations/hash/hash_model_renderer.h"
#include "representations/volume/train_volume.h"
#include "representations/volume/volume_model_renderer.h"

namespace tessera {
namespace {

// A model of any method, with the renderer that draws it.
template <class Model, class Renderer>
class DrawableModel final : public Drawable {
 public:
  DrawableModel(const fs::path& folder, std::unique_ptr<Model> model, std::unique_ptr<Renderer> renderer)
      : folder_(folder), model_(std::move(model)), renderer_(std::move(renderer)) {}

  ViewRenderer& renderer() override { return *renderer_; }
  Mat4d sourceFromWorld() const override { return folder_.readPlacement().sourceFromWorld; }
  void requireWorldOf(const Capture& capture) const override { requireSameWorld(folder_, capture); }
  std::vector<std::string> trainedOnAmong(const Capture& capture, Split split) const override {
    return tessera::trainedOnAmong(folder_, capture, split);
  }

 private:
  ModelFolder folder_;
  std::unique_ptr<Model> model_;
  std::unique_ptr<Renderer> renderer_;
};

}  // namespace

std::unique_ptr<Drawable> openDrawable(Device& device, const fs::path& folder, const DrawableOptions& options) {
  if (fs::exists(folder / "tileset.json")) return openScene(device, folder, options);
  const std::optional<ModelManifest> manifest = ModelFolder(folder).manifest();
  if (!manifest || manifest->method == "field") {
    auto model = loadFieldModel(device, folder);
    auto renderer = std::make_unique<FieldRenderer>(*model);
    return std::make_unique<DrawableModel<FieldModel, FieldRenderer>>(folder, std::move(model), std::move(renderer));
  }
  if (manifest->method == "volume") {
    auto model = loadVolumeModel(device, folder);
    const double progress =
        static_cast<double>(manifest->step) / static_cast<double>(std::max<int64_t>(1, manifest->plannedSteps));
    auto renderer = std::make_unique<VolumeModelRenderer>(*model, cullThreshold(model->config(), progress));
    return std::make_unique<DrawableModel<VolumeModel, VolumeModelRenderer>>(folder, std::move(model),
                                                                             std::move(renderer));
  }
  if (manifest->method == "hash") {
    auto model = loadHashModel(device, folder);
    auto renderer = std::make_unique<HashModelRenderer>(*model);
    return std::make_unique<DrawableModel<HashModel, HashModelRenderer>>(folder, std::move(model), std::move(renderer));
  }
  throw Error((folder / "manifest.json").string(), "method", "'" + manifest->method + "' is none that tessera knows",
              "restore the file, or use a newer tessera");
}

}  // namespace tessera
