#include "representations/mesh/vulkan/gpu_mesh_drawer.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "base/check.h"
#include "render/vulkan/kernel_variants.h"
#include "representations/mesh/content/infer_maps.h"
#include "representations/mesh/vulkan/frame_blend.h"
#include "representations/mesh/vulkan/gpu_inference.h"
#include "representations/mesh/vulkan/gpu_mesh_content.h"
#include "representations/mesh/vulkan/layer_lists.h"
#include "representations/mesh/vulkan/placed_parts.h"
#include "representations/mesh/vulkan/raster_view.h"
#include "representations/mesh/vulkan/visible_layers.h"
#include "shaders/composite_layers.h"
#include "shaders/decode_visible.h"
#include "shaders/decode_visible_decoded.h"

namespace tessera {
namespace {

arguments::RasterArguments rasterArguments(const RasterView& raster, const arguments::ViewArguments& view) {
  arguments::RasterArguments placed = {};
  Mat3d sceneFromCamera;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) sceneFromCamera(row, column) = view.sceneFromCamera[3 * row + column];
  const Mat3d rasterFromScene = raster.rasterFromCamera * sceneFromCamera.transpose();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column)
      placed.rasterFromScene[3 * row + column] = static_cast<float>(rasterFromScene(row, column));
  placed.focal[0] = static_cast<float>(raster.focalX);
  placed.focal[1] = static_cast<float>(raster.focalY);
  placed.centre[0] = static_cast<float>(raster.centreX);
  placed.centre[1] = static_cast<float>(raster.centreY);
  // Half of the depth of the nearest sample: rounding errors must not cut it.
  placed.near = static_cast<float>(0.5 * raster.smallestCosine * view.near);
  placed.width = raster.width;
  placed.height = raster.height;
  return placed;
}

// Returns the number with the digits of `index` in reverse order behind the point (Halton's sequence).
double radicalInverse(uint32_t index, uint32_t base) {
  double sum = 0, digit = 1;
  for (; index > 0; index /= base) sum += (digit /= base) * (index % base);
  return sum;
}

class GpuMeshDrawer final : public GpuDrawer {
 public:
  GpuMeshDrawer(const std::shared_ptr<GpuStream>& stream, const GpuMeshSettings& settings)
      : stream_(stream),
        settings_(settings),
        kernels_(stream->context()),
        parts_(stream),
        lists_(stream, settings.listedFragments),
        visible_(stream, settings.decodesFragments),
        blend_(stream),
        inference_(stream) {}

  ~GpuMeshDrawer() override {
    if (noise_) stream_->deferDestroy(std::move(noise_));
  }

  // Encoders are in GPU memory as far as the pool's budget allows, and otherwise only while maps are inferred.
  uint64_t residentBytesOfResource(uint64_t) const override { return 0; }

  std::unique_ptr<Content> prepare(std::unique_ptr<Content> content) const override {
    auto* decoded = dynamic_cast<ContentOf<MeshContent>*>(content.get());
    CHECK(decoded != nullptr);
    if (!decoded->value.encoders.empty() && !(infersOnGpu() && inference_.fits(decoded->value))) {
      const std::lock_guard lock(inferring_);
      inferMapsOnCpu(decoded->value, 0);
    }
    return content;
  }

  std::unique_ptr<GpuContent> upload(const Content& content) override {
    const MeshContent& mesh = contentAs<MeshContent>(content);
    auto onGpu = std::make_unique<GpuMeshContent>(stream_, mesh);
    if (!mesh.encoders.empty() && infersOnGpu() && inference_.fits(mesh)) inference_.infer(mesh, *onGpu);
    return onGpu;
  }

  void setPoolBudget(uint64_t bytes) override { inference_.setBudget(bytes); }

  void draw(GpuFrame& frame, const SceneView<GpuContent>& view, const ViewRequest& request,
            const DrawSettings& settings) override {
    frame.begin(view.frame, settings.minTransmittance, 0, request);
    if (!(request.camera == camera_)) {
      camera_ = request.camera;
      rasters_ = makeRasterViews(frame.directions(), stream_->context()->limits().maxFramebufferWidth);
    }
    const bool isChanged = parts_.place(view, view.frame.inScene(request.worldFromCamera.translation)) ||
                           frame.surroundings().hasOpaqueDepthChanged;
    arguments::MeshViewArguments mesh = {};
    mesh.view = frame.view();
    mesh.parts = parts_.address();
    mesh.isSamePixels = rasters_.isSamePixels ? 1 : 0;
    if (view.backgroundBlock != nullptr && frame.surroundings().endsRays) {
      mesh.sky = static_cast<const GpuMeshContent*>(view.backgroundBlock)->sky;
      mesh.skyEdge = static_cast<const GpuMeshContent*>(view.backgroundBlock)->skyEdge;
    }
    wantsAnotherFrame_ = false;
    if (settings.exact) {
      drawExact(frame, mesh);
      blend_.forget();
      return;
    }
    const bool isResting = blend_.isResting(request.camera, request.worldFromCamera, isChanged);
    if (settings_.blends && settings_.jitters && isResting) {
      mesh.jitter[0] = static_cast<float>(radicalInverse(blend_.framesAtRest(), 2) - 0.5);
      mesh.jitter[1] = static_cast<float>(radicalInverse(blend_.framesAtRest(), 3) - 0.5);
    }
    drawDithered(frame, mesh);
    if (!settings_.blends) return;
    const bool areAllBlended = settings_.jitters && isResting;
    blend_.blend(frame, request.camera, request.worldFromCamera, isChanged, areAllBlended ? 0 : mesh.noise);
    wantsAnotherFrame_ = blend_.framesAtRest() < kFramesAtRest;
  }

  bool crossFades() const override { return true; }
  double hysteresis() const override { return kMeshHysteresis; }

  bool wantsAnotherFrame() const override { return wantsAnotherFrame_; }

 private:
  bool infersOnGpu() const {
    if (settings_.inference != MeshInference::automatic) return settings_.inference == MeshInference::gpu;
    return !stream_->context()->isCpu();
  }

  static constexpr uint32_t kFramesAtRest = 64;  // their mean is shown where nothing moves

  void drawExact(GpuFrame& frame, arguments::MeshViewArguments& mesh) {
    const GpuKernel& composite = kernels_.get(kCompositeLayersSpirv, parts_.maxWidth());
    for (const RasterView& raster : rasters_.views) {
      mesh.raster = rasterArguments(raster, mesh.view);
      lists_.draw(mesh, parts_.all(),
                  [&](const arguments::MeshViewArguments& listed) { frame.run(composite, listed); });
    }
  }

  void drawDithered(GpuFrame& frame, arguments::MeshViewArguments& mesh) {
    const size_t bytes = size_t{mesh.view.width} * mesh.view.height * sizeof(float);
    if (noise_.bytes() < bytes) {
      if (noise_) stream_->deferDestroy(std::move(noise_));
      noise_ = GpuBuffer();
      noise_ = stream_->makeBuffer(bytes);
    }
    mesh.noise = noise_.address();
    mesh.frame = frameNumber_++;
    using Spirv = std::span<const uint32_t>;
    const Spirv spirv = settings_.decodesFragments ? Spirv(kDecodeVisibleDecodedSpirv) : Spirv(kDecodeVisibleSpirv);
    const GpuKernel& decode = kernels_.get(spirv, parts_.maxWidth());
    for (RasterView raster : rasters_.views) {
      if (rasters_.isSamePixels) {
        raster.centreX -= mesh.jitter[0];
        raster.centreY -= mesh.jitter[1];
      }
      mesh.raster = rasterArguments(raster, mesh.view);
      visible_.draw(mesh, parts_);
      frame.run(decode, mesh);
    }
  }

  std::shared_ptr<GpuStream> stream_;
  GpuMeshSettings settings_;
  KernelVariants kernels_;
  PlacedParts parts_;
  LayerLists lists_;
  VisibleLayers visible_;
  FrameBlend blend_;
  GpuInference inference_;
  mutable std::mutex inferring_;  // by one thread at a time, which uses all processors
  Camera camera_;                 // of the last image
  RasterViews rasters_;
  GpuBuffer noise_;
  uint32_t frameNumber_ = 0;
  bool wantsAnotherFrame_ = false;
};

}  // namespace

std::unique_ptr<GpuDrawer> makeGpuMeshDrawer(const std::shared_ptr<GpuStream>& stream,
                                             const GpuMeshSettings& settings) {
  return std::make_unique<GpuMeshDrawer>(stream, settings);
}
std::unique_ptr<GpuDrawer> makeGpuMeshDrawer(const std::shared_ptr<GpuStream>& stream) {
  return makeGpuMeshDrawer(stream, {});
}

}  // namespace tessera
