#include "render/vulkan/gpu_scene_renderer.h"

#include <algorithm>

#include "shaders/draw_hash.h"
#include "shaders/draw_hash_varying.h"
#include "shaders/draw_hash_varying_shared.h"
#include "shaders/draw_volume.h"
#include "shaders/end_hash.h"
#include "shaders/end_volume.h"
#include "tiles/scene_folder.h"

namespace tessera {

namespace {

// Numbers of a pixel (begin_view.comp).
constexpr uint32_t kNumbersOfVolume = 5, kNumbersOfHash = 9;

template <class Arguments, class Held>
Arguments drawArguments(const arguments::ViewArguments& view, const DrawnContent<Held>& where, bool isSurround) {
  Arguments made = {};
  made.view = view;
  for (int a = 0; a < 3; ++a) {
    made.low[a] = static_cast<float>(where.low[a]);
    made.high[a] = static_cast<float>(where.high[a]);
  }
  made.isSurround = isSurround;
  made.partCount = where.content->partCount;
  made.parts = where.content->parts;
  return made;
}

}  // namespace

template <class Content>
TileSource<typename OnCard<Content>::Type> GpuSceneRenderer<Content>::heldFrom(const TileSource<Content>& source) {
  TileSource<Held> made;
  made.bytes = source.bytes;
  made.load = [this, load = source.load](int tile) {
    const bool isRead = prefetch_ && prefetch_->isReady(tile);
    return Held(stream_, isRead ? prefetch_->take(tile) : load(tile));
  };
  made.folder = source.folder;
  made.file = source.file;
  return made;
}

template <class Content>
GpuSceneRenderer<Content>::GpuSceneRenderer(const std::shared_ptr<const GpuContext>& context, TileScene<Content> scene,
                                            const GpuRendererSettings& settings)
    : stream_(std::make_shared<GpuStream>(context)),
      prefetch_(settings.inBackground ? std::make_unique<TilePrefetch<Content>>(scene.source.load) : nullptr),
      tiles_(scene.frame, std::move(scene.tree), heldFrom(scene.source), settings.selection, settings.budgetBytes),
      settings_(settings),
      background_(scene.background[0], scene.background[1], scene.background[2]),
      picture_(stream_) {}

template <class Content>
const GpuKernel& GpuSceneRenderer<Content>::kernel(std::span<const uint32_t> spirv, uint32_t constant) {
  const auto key = std::make_pair(spirv.data(), constant);
  const auto found = kernels_.find(key);
  if (found != kernels_.end()) return found->second;
  return kernels_.try_emplace(key, stream_->context(), spirv, std::span(&constant, 1)).first->second;
}

template <class Content>
void GpuSceneRenderer<Content>::queue(const Camera& camera, const Pose& worldFromCamera, const ImageF* opaqueDepth) {
  const TileView view = tileView(camera, worldFromCamera, tiles_.frame());
  if (prefetch_) {
    tiles_.loadReadyFor(view, [this](const std::vector<int>& missing) {
      prefetch_->want(missing);
      const auto ready = [this](int tile) { return prefetch_->isReady(tile); };
      const auto found = std::find_if(missing.begin(), missing.end(), ready);
      return found == missing.end() ? -1 : *found;
    });
  } else {
    tiles_.loadFor(view);
  }
  Contents contents{tiles_.frontToBack(), 0};
  contents.inBox = contents.frontToBack.size();
  if (const Held* surround = tiles_.surround()) contents.frontToBack.emplace_back(surround);
  begin(contents, camera, worldFromCamera, opaqueDepth);
  for (size_t i = 0; i < contents.frontToBack.size(); ++i) {
    draw(*contents.frontToBack[i].content, contents.frontToBack[i], i >= contents.inBox);
  }
  end();
}

template <class Content>
RenderedView GpuSceneRenderer<Content>::render(const Camera& camera, const Pose& worldFromCamera,
                                               const ImageF* opaqueDepth) {
  queue(camera, worldFromCamera, opaqueDepth);
  return picture_.drawn();
}

template <class Content>
DrawnOnCard GpuSceneRenderer<Content>::draw(const Camera& camera, const Pose& worldFromCamera) {
  queue(camera, worldFromCamera, nullptr);
  stream_->send();
  return picture_.onCard();
}

template <class Content>
bool GpuSceneRenderer<Content>::hasMore() const {
  return std::any_of(tiles_.missing().begin(), tiles_.missing().end(),
                     [this](int tile) { return prefetch_->isReady(tile); });
}

template <class Content>
SceneState GpuSceneRenderer<Content>::state() const {
  const auto isDrawn = [](const SelectedTile& tile) { return tile.visible; };
  const std::vector<SelectedTile>& tiles = cut().tiles;
  const size_t inBox = static_cast<size_t>(std::count_if(tiles.begin(), tiles.end(), isDrawn));
  return {inBox + (cut().surround >= 0 ? 1 : 0), tiles_.missing().size(), static_cast<size_t>(choice().refused),
          cache().statistics(), cache().budgetBytes()};
}

template <>
void GpuSceneRenderer<VolumeContent>::begin(const Contents&, const Camera& camera, const Pose& worldFromCamera,
                                            const ImageF* opaqueDepth) {
  picture_.begin(tiles_.frame(), settings_.minTransmittance, kNumbersOfVolume, camera, worldFromCamera, opaqueDepth);
}

template <>
void GpuSceneRenderer<VolumeContent>::draw(const Held& content, const DrawnContent<Held>& where, bool isSurround) {
  auto draw = drawArguments<arguments::DrawVolumeArguments>(picture_.view(), where, isSurround);
  draw.layerCount = content.network.layerCount;
  draw.featureRange = content.featureRange;
  draw.densityRange = content.densityRange;
  draw.stepsPerTexel = content.stepsPerTexel;
  draw.layers = content.network.layers;
  draw.weights = content.network.weights;
  picture_.run(kernel(kDrawVolumeSpirv, content.network.mostWidth), draw);
}

template <>
void GpuSceneRenderer<VolumeContent>::end() {
  picture_.run(kernel(kEndVolumeSpirv, 0), picture_.view());
}

template <>
void GpuSceneRenderer<HashContent>::begin(const Contents& contents, const Camera& camera, const Pose& worldFromCamera,
                                          const ImageF* opaqueDepth) {
  networks_.clear();
  isWhole_ = false;
  // The last one's network speaks where nothing is met.
  std::vector<const Held*> all;
  for (const DrawnContent<Held>& drawn : contents.frontToBack) all.push_back(drawn.content);
  if (const Held* always = tiles_.always(); always && contents.inBox == contents.frontToBack.size())
    all.push_back(always);
  for (const Held* content : all) {
    isWhole_ |= content->isWhole;
    const bool known = std::any_of(networks_.begin(), networks_.end(),
                                   [&](const Held* other) { return other->layers == content->layers; });
    if (!known) networks_.push_back(content);
  }
  // So that `end` finds it at the back.
  if (!all.empty()) {
    const auto last = std::find_if(networks_.begin(), networks_.end(),
                                   [&](const Held* other) { return other->layers == all.back()->layers; });
    std::rotate(last, last + 1, networks_.end());
  }
  picture_.begin(tiles_.frame(), settings_.minTransmittance, kNumbersOfHash + static_cast<uint32_t>(networks_.size()),
                 camera, worldFromCamera, opaqueDepth);
}

template <>
void GpuSceneRenderer<HashContent>::draw(const Held& content, const DrawnContent<Held>& where, bool isSurround) {
  auto draw = drawArguments<arguments::DrawHashArguments>(picture_.view(), where, isSurround);
  const auto network = std::find_if(networks_.begin(), networks_.end(),
                                    [&](const Held* other) { return other->layers == content.layers; });
  draw.network = static_cast<uint32_t>(network - networks_.begin());
  draw.stepLength = content.step;
  draw.columns = content.columns;
  std::copy(content.levelWeights.begin(), content.levelWeights.end(), draw.levelWeights);
  draw.vectors = content.vectors;
  std::span<const uint32_t> spirv = kDrawHashSpirv;
  if (content.varies) spirv = kDrawHashVaryingSpirv;
  if (content.varies && content.weights == LevelWeights::shared) spirv = kDrawHashVaryingSharedSpirv;
  picture_.run(kernel(spirv, content.tables), draw);
}

template <>
void GpuSceneRenderer<HashContent>::end() {
  std::vector<arguments::NetworkArguments> table;
  uint32_t mostWidth = 1;
  for (const Held* content : networks_) {
    table.push_back({content->network.layers, content->network.weights, content->network.layerCount, 0});
    mostWidth = std::max(mostWidth, content->network.mostWidth);
  }
  arguments::EndHashArguments end = {};
  end.view = picture_.view();
  end.networkCount = static_cast<uint32_t>(table.size());
  end.ofNothing = table.empty() ? 0 : end.networkCount - 1;
  end.isWhole = isWhole_;
  if (!table.empty()) {
    const auto bytes = std::as_bytes(std::span(table));
    if (networkTable_.bytes() < bytes.size()) {
      stream_->retire(std::move(networkTable_));
      networkTable_ = GpuBuffer(stream_->context(), bytes.size());
    }
    stream_->upload(networkTable_, 0, bytes);
    end.networks = networkTable_.address();
  }
  picture_.run(kernel(kEndHashSpirv, std::max(mostWidth, 23u)), end);
}

template class GpuSceneRenderer<VolumeContent>;
template class GpuSceneRenderer<HashContent>;

std::unique_ptr<GpuViewRenderer> openGpuScene(const std::shared_ptr<const GpuContext>& context, const fs::path& folder,
                                              const GpuRendererSettings& settings) {
  if (readTileset(folder).representation == Representation::hash) {
    return std::make_unique<GpuHashRenderer>(context, openTileScene<HashContent>(folder), settings);
  }
  return std::make_unique<GpuVolumeRenderer>(context, openTileScene<VolumeContent>(folder), settings);
}

}  // namespace tessera
