#include "render/vulkan/gpu_scene_renderer.h"

#include <algorithm>

namespace tessera {

std::function<std::unique_ptr<Content>(int tile)> GpuSceneRenderer::prepared(const TileSource<Content>& source) const {
  return [drawer = drawer_.get(), load = source.load](int tile) { return drawer->prepare(load(tile)); };
}

TileSource<GpuContent> GpuSceneRenderer::uploaded(const TileSource<Content>& source) {
  TileSource<GpuContent> gpuSource;
  gpuSource.bytes = [this, bytes = source.bytes](int tile) { return drawer_->residentBytes(bytes(tile)); };
  gpuSource.load = [this, load = prepared(source)](int tile) {
    const bool isRead = prefetch_ && prefetch_->isReady(tile);
    return drawer_->upload(*(isRead ? prefetch_->take(tile) : load(tile)));
  };
  gpuSource.folder = source.folder;
  gpuSource.file = source.file;
  gpuSource.tileResources = source.tileResources;
  gpuSource.bytesOfResource = [this, bytes = source.bytesOfResource](int resource) {
    return drawer_->residentBytesOfResource(bytes(resource));
  };
  gpuSource.holdResources = source.holdResources;
  return gpuSource;
}

GpuSceneRenderer::GpuSceneRenderer(std::shared_ptr<GpuStream> stream, std::unique_ptr<GpuDrawer> drawer,
                                   TileScene scene, const GpuRendererSettings& settings)
    : stream_(std::move(stream)),
      drawer_(std::move(drawer)),
      prefetch_(settings.inBackground ? std::make_unique<TilePrefetch<std::unique_ptr<Content>>>(prepared(scene.source))
                                      : nullptr),
      tiles_(scene.frame, std::move(scene.tree), uploaded(scene.source), selectionFor(*drawer_, settings.selection),
             settings.budgetBytes),
      settings_(settings),
      background_(scene.background[0], scene.background[1], scene.background[2]),
      frame_(stream_) {
  drawer_->setPoolBudget(settings.poolBytes);
}

void GpuSceneRenderer::queue(const ViewRequest& request, bool exact) {
  const TileView view = tileView(request.camera, request.worldFromCamera, tiles_.frame());
  if (prefetch_) {
    tiles_.loadReadyFor(view, [this](const std::vector<int>& missing) {
      prefetch_->request(missing);
      const auto ready = [this](int tile) { return prefetch_->isReady(tile); };
      const auto it = std::find_if(missing.begin(), missing.end(), ready);
      return it == missing.end() ? -1 : *it;
    });
  } else {
    tiles_.loadFor(view);
  }
  DrawSettings settings = settings_.draw;
  settings.exact = exact;
  SceneView<GpuContent> seen = tiles_.view(!exact && drawer_->crossFades());
  if (frame_.surroundings().withinBox) {
    seen.backgroundBlock = nullptr;
    for (DrawnContent<GpuContent>& drawn : seen.frontToBack) {
      drawn.low = drawn.low.cwiseMax(seen.frame.low);
      drawn.high = drawn.high.cwiseMin(seen.frame.high);
    }
  }
  drawer_->draw(frame_, seen, request, settings);
}

RenderedView GpuSceneRenderer::render(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  queue({camera, worldFromCamera, opaqueDepth}, true);
  return frame_.drawn();
}

GpuRenderedView GpuSceneRenderer::draw(const Camera& camera, const Pose& worldFromCamera) {
  queue({camera, worldFromCamera}, settings_.draw.exact);
  stream_->send();
  return frame_.onGpu();
}

GpuRenderedView GpuSceneRenderer::queueAmong(const Camera& camera, const Pose& worldFromCamera,
                                             GpuSurroundings surroundings, bool exact) {
  frame_.setSurroundings(std::move(surroundings));
  queue({camera, worldFromCamera}, exact);
  return frame_.onGpu();
}

bool GpuSceneRenderer::hasMore() const {
  return drawer_->wantsAnotherFrame() || tiles_.isFading() ||
         std::any_of(tiles_.missing().begin(), tiles_.missing().end(),
                     [this](int tile) { return prefetch_->isReady(tile); });
}

SceneState GpuSceneRenderer::state() const {
  const auto isDrawn = [](const SelectedTile& tile) { return tile.visible; };
  const std::vector<SelectedTile>& tiles = cut().tiles;
  const size_t inBox = static_cast<size_t>(std::count_if(tiles.begin(), tiles.end(), isDrawn));
  return {inBox + (cut().backgroundBlock >= 0 ? 1 : 0), tiles_.missing().size(), static_cast<size_t>(choice().refused),
          cache().statistics(), cache().budgetBytes()};
}

}  // namespace tessera
