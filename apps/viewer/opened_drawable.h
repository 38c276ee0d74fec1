// A model, whose newest checkpoint is drawn while it is being trained; or a scene, which stays what it is.
#pragma once

#include <memory>
#include <optional>

#include "apps/tessera/drawable.h"
#include "apps/viewer/worker_pictures.h"
#include "train/model_folder.h"

namespace tessera {

class OpenedDrawable final : public ChangingRenderer {
 public:
  // Throws Error as makeDevice and openDrawable do; refresh() throws where a newer checkpoint cannot be read, again and
  // again.
  OpenedDrawable(const fs::path& folder, const DeviceOptions& device, const DrawableOptions& options);

  bool refresh() override;
  ViewRenderer& renderer() override { return drawable_->renderer(); }
  PictureSource::Facts facts() const override;

 private:
  void open();

  fs::path folder_;
  DrawableOptions options_;
  std::unique_ptr<Device> device_;
  std::unique_ptr<Drawable> drawable_;
  std::optional<ModelManifest> manifest_;  // of a model: of the checkpoint that is drawn
};

}  // namespace tessera
