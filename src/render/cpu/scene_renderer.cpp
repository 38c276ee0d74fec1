#include "render/cpu/scene_renderer.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/check.h"
#include "render/cpu/simd_target.h"

namespace tessera {
namespace {

TileSource<Content> preparedBy(const CpuDrawer& drawer, TileSource<Content> source, int threads) {
  source.bytes = [&drawer, bytes = source.bytes](int tile) { return drawer.residentBytes(bytes(tile)); };
  source.bytesOfResource = [&drawer, bytes = source.bytesOfResource](int resource) {
    return drawer.residentBytesOfResource(bytes(resource));
  };
  source.load = [&drawer, threads, load = source.load](int tile) { return drawer.prepare(load(tile), threads); };
  return source;
}

}  // namespace

SceneRenderer::SceneRenderer(std::unique_ptr<CpuDrawer> drawer, const TileFrame& frame, TileTree tree,
                             TileSource<Content> source, const SceneRendererSettings& settings)
    : drawer_(std::move(drawer)),
      tiles_(frame, std::move(tree), preparedBy(*drawer_, std::move(source), settings.threads),
             selectionFor(*drawer_, settings.selection), settings.budgetBytes),
      settings_(settings),
      pool_(settings.threads) {
  const std::vector<std::string_view> modes = drawer_->skippingModes();
  const std::string_view requested = settings.draw.skipping;
  CHECK((requested.empty() || std::find(modes.begin(), modes.end(), requested) != modes.end()) == true);
}

std::string SceneRenderer::device() const {
  return fmt::format("cpu {}, {} threads", renderSimdTarget(), pool_.threads());
}

void SceneRenderer::prepare(const Camera& camera, const Pose& worldFromCamera) {
  tiles_.loadFor(tileView(camera, worldFromCamera, tiles_.frame()));
}

RenderedView SceneRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  prepare(camera, worldFromCamera);
  return drawer_->draw(tiles_.view(), {camera, worldFromCamera, opaqueDepth}, settings_.draw, pool_, counts_);
}

}  // namespace tessera
