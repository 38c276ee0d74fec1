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

constexpr uint32_t kNumbersOfPixel = 9;  // begin_view.comp, and one for each network

const GpuHashContent& hashOf(const GpuContent* content) {
  return static_cast<const GpuHashContent&>(*content);
}

class GpuHashDrawer final : public GpuDrawer {
 public:
  explicit GpuHashDrawer(const std::shared_ptr<GpuStream>& stream) : stream_(stream), kernels_(stream->context()) {}

  std::unique_ptr<GpuContent> upload(const Content& content) override {
    return std::make_unique<GpuHashContent>(stream_, contentAs<HashContent>(content));
  }

  void draw(GpuPicture& picture, const SceneView<GpuContent>& view, const PictureRequest& request,
            const DrawSettings& settings) override {
    findNetworks(view);
    picture.begin(view.frame, settings.minTransmittance, kNumbersOfPixel + static_cast<uint32_t>(networks_.size()),
                  request);
    for (const DrawnContent<GpuContent>& drawn : view.frontToBack) add(picture, drawn, false);
    if (view.surround != nullptr) add(picture, view.surround, true);
    end(picture);
  }

 private:
  // One content for each network of the picture; the last one's speaks where nothing is met.
  void findNetworks(const SceneView<GpuContent>& view) {
    networks_.clear();
    isWhole_ = false;
    std::vector<const GpuHashContent*> all;
    for (const DrawnContent<GpuContent>& drawn : view.frontToBack) all.push_back(&hashOf(drawn.content));
    if (view.surround != nullptr) {
      all.push_back(&hashOf(view.surround));
    } else if (view.pinned != nullptr) {
      all.push_back(&hashOf(view.pinned));
    }
    for (const GpuHashContent* content : all) {
      isWhole_ |= content->isWhole;
      if (networkOf(*content) == networks_.end()) networks_.push_back(content);
    }
    // So that `end` finds it at the back.
    if (!all.empty()) {
      const auto last = networkOf(*all.back());
      std::rotate(last, last + 1, networks_.end());
    }
  }

  std::vector<const GpuHashContent*>::iterator networkOf(const GpuHashContent& content) {
    return std::find_if(networks_.begin(), networks_.end(),
                        [&](const GpuHashContent* other) { return other->layers == content.layers; });
  }

  void add(GpuPicture& picture, const DrawnContent<GpuContent>& drawn, bool isSurround) {
    const GpuHashContent& content = hashOf(drawn.content);
    auto draw = drawArguments<arguments::DrawHashArguments>(picture.view(), content, drawn.low, drawn.high, isSurround);
    draw.network = static_cast<uint32_t>(networkOf(content) - networks_.begin());
    draw.stepLength = content.step;
    draw.columns = content.columns;
    std::copy(content.levelWeights.begin(), content.levelWeights.end(), draw.levelWeights);
    draw.vectors = content.vectors;
    std::span<const uint32_t> spirv = kDrawHashSpirv;
    if (content.varies) spirv = kDrawHashVaryingSpirv;
    if (content.varies && content.weights == LevelWeights::shared) spirv = kDrawHashVaryingSharedSpirv;
    picture.run(kernels_.get(spirv, content.tables), draw);
  }

  void end(GpuPicture& picture) {
    std::vector<arguments::NetworkArguments> table;
    uint32_t mostWidth = 1;
    for (const GpuHashContent* content : networks_) {
      table.push_back({content->network.layers, content->network.weights, content->network.layerCount, 0});
      mostWidth = std::max(mostWidth, content->network.mostWidth);
    }
    arguments::EndHashArguments end = {};
    end.view = picture.view();
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
    picture.run(kernels_.get(kEndHashSpirv, std::max(mostWidth, 23u)), end);
  }

  std::shared_ptr<GpuStream> stream_;
  KernelVariants kernels_;
  std::vector<const GpuHashContent*> networks_;
  bool isWhole_ = false;  // a content is
  GpuBuffer networkTable_;
};

}  // namespace

std::unique_ptr<GpuDrawer> makeGpuHashDrawer(const std::shared_ptr<GpuStream>& stream) {
  return std::make_unique<GpuHashDrawer>(stream);
}

}  // namespace tessera
