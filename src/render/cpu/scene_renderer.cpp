#include "render/cpu/scene_renderer.h"

#include <fmt/format.h>

namespace tessera {

template <class Content>
SceneRenderer<Content>::SceneRenderer(const TileFrame& frame, TileTree tree, TileSource<Content> source,
                                      const SceneRendererSettings& settings)
    : frame_(frame),
      tree_(std::move(tree)),
      settings_(settings),
      cache_(tree_, settings.budgetBytes, std::move(source)),
      selector_(tree_, settings.selection),
      pool_(settings.threads) {}

template <class Content>
std::string SceneRenderer<Content>::device() const {
  return fmt::format("cpu {}, {} threads", renderSimdTarget(), pool_.threads());
}

template <class Content>
void SceneRenderer<Content>::loadFor(const TileView& view) {
  const auto holds = [this](int tile) { return cache_.holds(tile); };
  choice_ = selector_.choose(view, {cache_.budgetBytes(), holds, [this](int tile) { return cache_.bytesOf(tile); }});
  cache_.load(choice_.wanted);
  cut_ = selector_.cut(view, holds);
}

template <class Content>
void SceneRenderer<Content>::prepare(const Camera& camera, const Pose& worldFromCamera) {
  loadFor(tileView(camera, worldFromCamera, frame_));
}

template <class Content>
RenderedView SceneRenderer<Content>::render(const Camera& camera, const Pose& worldFromCamera,
                                            const ImageF* opaqueDepth) {
  prepare(camera, worldFromCamera);
  SceneDrawing<Content> drawing{frame_, {}, nullptr, settings_.march};
  for (const SelectedTile& selected : cut_.tiles) {
    if (!selected.visible) continue;
    DrawnContent<Content>& drawn = drawing.frontToBack.emplace_back(cache_.find(selected.content));
    if (selected.content == selected.tile) continue;
    const TileBox cells = tree_.boxOfCells(selected.tile);
    drawn.low = cells.low;
    drawn.high = cells.high;
  }
  if (cut_.surround >= 0) drawing.surround = cache_.find(cut_.surround);
  if (const std::vector<int> coarsest = tree_.coarsest(); drawing.surround == nullptr && !coarsest.empty()) {
    drawing.ofNothing = cache_.find(coarsest.front());  // always there, whatever is in view
  }
  directions_.update(camera, pool_);
  return drawScene(drawing, directions_, worldFromCamera, opaqueDepth, pool_, &counts_);
}

template class SceneRenderer<VolumeContent>;
template class SceneRenderer<HashContent>;

}  // namespace tessera
