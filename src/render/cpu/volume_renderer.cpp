#include "render/cpu/volume_renderer.h"

#include <fmt/format.h>

#include <cmath>

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
    std::vector<int> kept;
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
  if (tree_.surround >= 0) drawing.surround = cache_.find(tree_.surround);
  return drawVolume(drawing, camera, worldFromCamera, opaqueDepth, pool_, &counts_);
}

TileTree flatTileTree(const std::vector<VolumeContent>& contents, bool withSurround) {
  TileTree tree;
  TileNode root;
  root.hasContent = false;
  root.level = 1;
  root.low = Vec3d::Constant(INFINITY);
  root.high = Vec3d::Constant(-INFINITY);
  tree.tiles.push_back(root);
  for (const VolumeContent& content : contents) {
    TileNode node;
    node.parent = 0;
    node.low = Vec3d::Constant(INFINITY);
    node.high = Vec3d::Constant(-INFINITY);
    for (const VolumePart& part : content.parts) {
      node.low = node.low.cwiseMin(Eigen::Map<const Vec3f>(part.low.data()).cast<double>());
      node.high = node.high.cwiseMax(Eigen::Map<const Vec3f>(part.high.data()).cast<double>());
    }
    tree.tiles[0].low = tree.tiles[0].low.cwiseMin(node.low);
    tree.tiles[0].high = tree.tiles[0].high.cwiseMax(node.high);
    tree.tiles[0].children.push_back(static_cast<int>(tree.tiles.size()));
    tree.tiles.push_back(node);
  }
  TileNode& whole = tree.tiles[0];
  tree.columns = static_cast<int>(std::lround(0.5 * (whole.high.x() - whole.low.x())));
  tree.rows = static_cast<int>(std::lround(0.5 * (whole.high.y() - whole.low.y())));
  for (TileNode& node : tree.tiles) {
    const auto cell = [](double x, double from) { return static_cast<int>(std::lround(0.5 * (x - from))); };
    node.cells = {cell(node.low.x(), whole.low.x()), cell(node.low.y(), whole.low.y()),
                  cell(node.high.x(), whole.low.x()), cell(node.high.y(), whole.low.y())};
  }
  if (withSurround) {
    tree.surround = static_cast<int>(tree.tiles.size());
    tree.tiles.emplace_back();
  }
  return tree;
}

}  // namespace tessera
