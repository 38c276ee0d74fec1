#include "render/cpu/scene_renderer.h"

#include <fmt/format.h>

namespace tessera {

template <class Content>
SceneRenderer<Content>::SceneRenderer(const TileFrame& frame, TileTree tree, TileSource<Content> source,
                                      const SceneRendererSettings& settings)
    : tiles_(frame, std::move(tree), std::move(source), settings.selection, settings.budgetBytes),
      settings_(settings),
      pool_(settings.threads) {}

template <class Content>
std::string SceneRenderer<Content>::device() const {
  return fmt::format("cpu {}, {} threads", renderSimdTarget(), pool_.threads());
}

template <class Content>
void SceneRenderer<Content>::prepare(const Camera& camera, const Pose& worldFromCamera) {
  tiles_.loadFor(tileView(camera, worldFromCamera, tiles_.frame()));
}

template <class Content>
RenderedView SceneRenderer<Content>::render(const Camera& camera, const Pose& worldFromCamera,
                                            const ImageF* opaqueDepth) {
  prepare(camera, worldFromCamera);
  SceneDrawing<Content> drawing{tiles_.frame(), tiles_.frontToBack(), tiles_.surround(), settings_.march};
  if (drawing.surround == nullptr) drawing.ofNothing = tiles_.always();
  directions_.update(camera, pool_);
  return drawScene(drawing, directions_, worldFromCamera, opaqueDepth, pool_, &counts_);
}

template class SceneRenderer<VolumeContent>;
template class SceneRenderer<HashContent>;

}  // namespace tessera
