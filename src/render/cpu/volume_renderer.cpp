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

// Each round loads the most urgent request that there is room for. What a round draws is kept by the next, so the cut
// only ever comes nearer to what the view asks for.
void VolumeRenderer::loadFor(const TileView& view) {
  for (bool changed = true; changed;) {
    selection_ = selector_.select(view, [this](int tile) { return cache_.holds(tile); });
    std::vector<int> kept = {selection_.surround};
    for (const SelectedTile& selected : selection_.cut) {
      if (selected.visible) kept.push_back(selected.tile);
    }
    changed = false;
    for (const TileRequest& request : selection_.requests) {
      std::vector<int> keptBeside = kept;
      keptBeside.insert(keptBeside.end(), request.beside.begin(), request.beside.end());
      if (cache_.load(request.tiles, keptBeside)) {
        changed = true;
        break;
      }
    }
  }
}

void VolumeRenderer::prepare(const Camera& camera, const Pose& worldFromCamera) {
  loadFor(tileView(camera, worldFromCamera, frame_));
}

RenderedView VolumeRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  prepare(camera, worldFromCamera);
  VolumeDrawing drawing{frame_, {}, nullptr, settings_.march};
  for (const SelectedTile& selected : selection_.cut) {
    if (selected.visible) drawing.frontToBack.push_back(cache_.find(selected.tile));
  }
  if (selection_.surround >= 0) drawing.surround = cache_.find(selection_.surround);
  return drawVolume(drawing, camera, worldFromCamera, opaqueDepth, pool_, &counts_);
}

}  // namespace tessera
