#include "representations/volume/vulkan/gpu_volume_drawer.h"

#include "raymarch/vulkan/part_arguments.h"
#include "render/vulkan/kernel_variants.h"
#include "representations/volume/vulkan/gpu_volume_content.h"
#include "shaders/draw_volume.h"
#include "shaders/end_volume.h"
#include "shaders/representations/volume/arguments_volume.h"

namespace tessera {
namespace {

constexpr uint32_t kNumbersOfPixel = 5;  // see begin_view.comp

class GpuVolumeDrawer final : public GpuDrawer {
 public:
  explicit GpuVolumeDrawer(const std::shared_ptr<GpuStream>& stream) : stream_(stream), kernels_(stream->context()) {}

  std::unique_ptr<GpuContent> upload(const Content& content) override {
    return std::make_unique<GpuVolumeContent>(stream_, contentAs<VolumeContent>(content));
  }

  void draw(GpuFrame& frame, const SceneView<GpuContent>& view, const ViewRequest& request,
            const DrawSettings& settings) override {
    frame.begin(view.frame, settings.minTransmittance, kNumbersOfPixel, request);
    for (const DrawnContent<GpuContent>& drawn : view.frontToBack) add(frame, drawn, false);
    if (view.backgroundBlock != nullptr) add(frame, view.backgroundBlock, true);
    frame.run(kernels_.get(kEndVolumeSpirv, 0), frame.view());
  }

 private:
  void add(GpuFrame& frame, const DrawnContent<GpuContent>& drawn, bool isBackgroundBlock) {
    const auto& content = static_cast<const GpuVolumeContent&>(*drawn.content);
    auto draw =
        drawArguments<arguments::DrawVolumeArguments>(frame.view(), content, drawn.low, drawn.high, isBackgroundBlock);
    draw.layerCount = content.network.layerCount;
    draw.featureRange = content.featureRange;
    draw.densityRange = content.densityRange;
    draw.stepsPerTexel = content.stepsPerTexel;
    draw.layers = content.network.layers;
    draw.weights = content.network.weights;
    frame.run(kernels_.get(kDrawVolumeSpirv, content.network.maxWidth), draw);
  }

  std::shared_ptr<GpuStream> stream_;
  KernelVariants kernels_;
};

}  // namespace

std::unique_ptr<GpuDrawer> makeGpuVolumeDrawer(const std::shared_ptr<GpuStream>& stream) {
  return std::make_unique<GpuVolumeDrawer>(stream);
}

}  // namespace tessera
