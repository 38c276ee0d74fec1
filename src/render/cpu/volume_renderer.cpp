#include "render/cpu/volume_renderer.h"

#include <fmt/format.h>

namespace tessera {

VolumeRenderer::VolumeRenderer(const VolumeFrame& frame, TileTree tree, TileSource source,
                               const VolumeRendererSettings& settings)
    : frame_(frame),
      tree_(std::move(tree)),
      settings_(settings),
      cache_(tree_, settings.budgetBytes, std::move(source)),
      selector_(tree_, settings.selection),
      pool_(settings.threads) {}

std::string VolumeRenderer::device() const {
  return fmt::format("cpu {}, {} threads", renderSimdTarget(), pool_.threads());
}

void VolumeRenderer::loadFor(const TileView& view) {
  const auto holds = [this](int tile) { return cache_.holds(tile); };
  choice_ = selector_.choose(view, {cache_.budgetBytes(), holds, [this](int tile) { return cache_.bytesOf(tile); }});
  cache_.load(choice_.wanted);
  cut_ = selector_.cut(view, holds);
}

void VolumeRenderer::prepare(const Camera& camera, const Pose& worldFromCamera) {
  loadFor(tileView(camera, worldFromCamera, frame_));
}

RenderedView VolumeRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  prepare(camera, worldFromCamera);
  VolumeDrawing drawing{frame_, {}, nullptr, settings_.march};
  for (const SelectedTile& selected : cut_.tiles) {
    if (!selected.visible) continue;
    DrawnVolume& drawn = drawing.frontToBack.emplace_back(cache_.find(selected.content));
    if (selected.content == selected.tile) continue;
    const TileBox cells = tree_.boxOfCells(selected.tile);
    drawn.low = cells.low;
    drawn.high = cells.high;
  }
  if (cut_.surround >= 0) drawing.surround = cache_.find(cut_.surround);
  return drawVolume(drawing, camera, worldFromCamera, opaqueDepth, pool_, &counts_);
}

}  // namespace tessera
