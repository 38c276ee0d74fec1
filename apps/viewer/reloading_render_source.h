// Renders a model, always from its newest checkpoint while it is being trained; or a scene, which does not change.
#pragma once

#include <memory>
#include <optional>

#include "apps/tessera/render_source.h"
#include "apps/viewer/async_frame_source.h"
#include "train/model_folder.h"

namespace tessera {

class ReloadingRenderSource final : public ChangingRenderer {
 public:
  // Throws Error as makeDevice and openRenderSource do; refresh() throws Error every time while a newer checkpoint
  // cannot be read.
  ReloadingRenderSource(const fs::path& folder, const DeviceOptions& device, const RenderSourceOptions& options);

  bool refresh() override;
  ViewRenderer& renderer() override { return renderSource_->renderer(); }
  FrameSource::Facts facts() const override;

 private:
  void open();

  fs::path folder_;
  RenderSourceOptions options_;
  std::unique_ptr<Device> device_;
  std::unique_ptr<RenderSource> renderSource_;
  std::optional<ModelManifest> manifest_;  // of a model: manifest of the checkpoint that is drawn
};

}  // namespace tessera
