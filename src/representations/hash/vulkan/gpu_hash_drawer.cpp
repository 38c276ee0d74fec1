#include "representations/hash/vulkan/gpu_hash_drawer.h"

#include <algorithm>

#include "raymarch/vulkan/part_arguments.h"
#include "render/vulkan/kernel_variants.h"
#include "representations/hash/vulkan/gpu_hash_content.h"
#include "shaders/draw_hash.h"
#include "shaders/draw_hash_varying.h"
#include "shaders/draw_hash_varying_shared.h"
#include "shaders/end_hash.h"
#include "shaders/representations/hash/arguments_hash.h"

namespace tessera {
namespace {

constexpr uint32_t kNumbersOfPixel = 9;  // see begin_view.comp; each network adds one

const GpuHashContent& toHashContent(const GpuContent* content) {
  return static_cast<const GpuHashContent&>(*content);
}

class GpuHashDrawer final : public GpuDrawer {
 public:
  explicit GpuHashDrawer(const std::shared_ptr<GpuStream>& stream) : stream_(stream), kernels_(stream->context()) {}

  std::unique_ptr<GpuContent> upload(const Content& content) override {
    return std::make_unique<GpuHashContent>(stream_, contentAs<HashContent>(content));
  }

  void draw(GpuFrame& frame, const SceneView<GpuContent>& view, const ViewRequest& request,
            const DrawSettings& settings) override {
    findNetworks(view);
    frame.begin(view.frame, settings.minTransmittance, kNumbersOfPixel + static_cast<uint32_t>(networks_.size()),
                request);
    for (const DrawnContent<GpuContent>& drawn : view.frontToBack) add(frame, drawn, false);
    if (view.backgroundBlock != nullptr) add(frame, view.backgroundBlock, true);
    end(frame);
  }

 private:
  // Collects one content for each network of the image. The last network is used where a ray hits nothing.
  void findNetworks(const SceneView<GpuContent>& view) {
    networks_.clear();
    hasLearnedBackground_ = false;
    std::vector<const GpuHashContent*> all;
    for (const DrawnContent<GpuContent>& drawn : view.frontToBack) all.push_back(&toHashContent(drawn.content));
    if (view.backgroundBlock != nullptr) {
      all.push_back(&toHashContent(view.backgroundBlock));
    } else if (view.pinned != nullptr) {
      all.push_back(&toHashContent(view.pinned));
    }
    for (const GpuHashContent* content : all) {
      hasLearnedBackground_ |= content->hasLearnedBackground;
      if (findNetwork(*content) == networks_.end()) networks_.push_back(content);
    }
    // The last content's network must be at the back, where `end` expects it.
    if (!all.empty()) {
      const auto last = findNetwork(*all.back());
      std::rotate(last, last + 1, networks_.end());
    }
  }

  std::vector<const GpuHashContent*>::iterator findNetwork(const GpuHashContent& content) {
    return std::find_if(networks_.begin(), networks_.end(),
                        [&](const GpuHashContent* other) { return other->layers == content.layers; });
  }

  void add(GpuFrame& frame, const DrawnContent<GpuContent>& drawn, bool isBackgroundBlock) {
    const GpuHashContent& content = toHashContent(drawn.content);
    auto draw =
        drawArguments<arguments::DrawHashArguments>(frame.view(), content, drawn.low, drawn.high, isBackgroundBlock);
    draw.network = static_cast<uint32_t>(findNetwork(content) - networks_.begin());
    draw.stepLength = content.step;
    draw.columns = content.columns;
    std::copy(content.levelWeights.begin(), content.levelWeights.end(), draw.levelWeights);
    draw.vectors = content.vectors;
    std::span<const uint32_t> spirv = kDrawHashSpirv;
    if (content.varies) spirv = kDrawHashVaryingSpirv;
    if (content.varies && content.weights == LevelWeights::shared) spirv = kDrawHashVaryingSharedSpirv;
    frame.run(kernels_.get(spirv, content.tables), draw);
  }

  void end(GpuFrame& frame) {
    std::vector<arguments::NetworkArguments> table;
    uint32_t maxWidth = 1;
    for (const GpuHashContent* content : networks_) {
      table.push_back({content->network.layers, content->network.weights, content->network.layerCount, 0});
      maxWidth = std::max(maxWidth, content->network.maxWidth);
    }
    arguments::EndHashArguments end = {};
    end.view = frame.view();
    end.networkCount = static_cast<uint32_t>(table.size());
    end.backgroundContent = table.empty() ? 0 : end.networkCount - 1;
    end.hasLearnedBackground = hasLearnedBackground_ && frame.surroundings().endsRays;
    if (!table.empty()) {
      const auto bytes = std::as_bytes(std::span(table));
      if (networkTable_.bytes() < bytes.size()) {
        stream_->deferDestroy(std::move(networkTable_));
        networkTable_ = GpuBuffer(stream_->context(), bytes.size());
      }
      stream_->upload(networkTable_, 0, bytes);
      end.networks = networkTable_.address();
    }
    frame.run(kernels_.get(kEndHashSpirv, std::max(maxWidth, 23u)), end);
  }

  std::shared_ptr<GpuStream> stream_;
  KernelVariants kernels_;
  std::vector<const GpuHashContent*> networks_;
  bool hasLearnedBackground_ = false;  // of any content
  GpuBuffer networkTable_;
};

}  // namespace

std::unique_ptr<GpuDrawer> makeGpuHashDrawer(const std::shared_ptr<GpuStream>& stream) {
  return std::make_unique<GpuHashDrawer>(stream);
}

}  // namespace tessera
