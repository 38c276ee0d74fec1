#include "representations/mesh/vulkan/visible_layers.h"

#include "shaders/dither_layers.h"
#include "shaders/dither_layers_decoded.h"
#include "shaders/patch_triangles_places.h"

namespace tessera {
namespace {

using Spirv = std::span<const uint32_t>;

constexpr ImageFormat kVisible = ImageFormat::rg32Uint, kDecoded = ImageFormat::rgba32Float;

GraphicsPipelineOptions ditheringOptions(ImageFormat format) {
  GraphicsPipelineOptions options;
  options.colours = {{format}};
  options.depth = ImageFormat::depth32Float;
  options.depthCompare = VK_COMPARE_OP_GREATER;
  options.fragmentStores = true;
  return options;
}

size_t bytesOfNearest(ImageSize size) {
  return size_t{size.width} * size.height * sizeof(float);
}

}  // namespace

VisibleLayers::~VisibleLayers() {
  for (auto* pass : {&background_, &tiles_, &more_})
    if (*pass) stream_->deferDestroy(std::move(*pass));
  if (image_) stream_->deferDestroy(std::move(image_));
  for (GpuBuffer* buffer : {&visible_, &nearest_, &solid_, &view_})
    if (*buffer) stream_->deferDestroy(std::move(*buffer));
}

const GpuGraphicsPipeline& VisibleLayers::pipelineFor(uint32_t maxWidth) {
  std::unique_ptr<GpuGraphicsPipeline>& pipeline = pipelines_[decodesFragments_ ? maxWidth : 0];
  if (pipeline) return *pipeline;
  GraphicsPipelineOptions options = ditheringOptions(decodesFragments_ ? kDecoded : kVisible);
  if (decodesFragments_) options.constants = {maxWidth};
  const Spirv fragments = decodesFragments_ ? Spirv(kDitherLayersDecodedSpirv) : Spirv(kDitherLayersSpirv);
  pipeline = std::make_unique<GpuGraphicsPipeline>(stream_->context(), kPatchTrianglesPlacesSpirv, fragments, options);
  return *pipeline;
}

void VisibleLayers::ensureRaster(ImageSize size) {
  const std::shared_ptr<const GpuContext>& context = stream_->context();
  if (!view_) view_ = stream_->makeBuffer(sizeof(arguments::MeshViewArguments));
  if (image_ && image_->size() == size) return;
  for (auto* pass : {&background_, &tiles_, &more_})
    if (*pass) stream_->deferDestroy(std::move(*pass));
  if (image_) stream_->deferDestroy(std::move(image_));
  image_ = stream_->makeImage(size, decodesFragments_ ? kDecoded : kVisible);
  const std::shared_ptr<GpuImage> depth = stream_->makeImage(size, ImageFormat::depth32Float);
  const auto makePass = [&](LoadOperation colours, LoadOperation depths) {
    return std::make_shared<GpuRenderPass>(context, std::vector<ColourAttachment>{{.image = image_, .load = colours}},
                                           DepthAttachment{.image = depth, .load = depths, .clearDepth = 0});
  };
  background_ = makePass(LoadOperation::clear, LoadOperation::clear);
  tiles_ = makePass(LoadOperation::keep, LoadOperation::clear);
  more_ = makePass(LoadOperation::keep, LoadOperation::keep);
  if (visible_.bytes() < image_->copiedBytes()) {
    if (visible_) stream_->deferDestroy(std::move(visible_));
    visible_ = GpuBuffer();
    visible_ = stream_->makeBuffer(image_->copiedBytes());
    if (nearest_) stream_->deferDestroy(std::move(nearest_));
    nearest_ = GpuBuffer();
    nearest_ = stream_->makeBuffer(bytesOfNearest(size));
    if (solid_) stream_->deferDestroy(std::move(solid_));
    solid_ = GpuBuffer();
  }
}

void VisibleLayers::draw(arguments::MeshViewArguments& view, const PlacedParts& parts) {
  const GpuGraphicsPipeline& pipeline = pipelineFor(parts.maxWidth());
  ensureRaster({view.raster.width, view.raster.height});
  view.visible = visible_.address();
  view.nearest = nearest_.address();
  view.solid = 0;
  if (view.view.surface != 0) {
    if (!solid_) solid_ = stream_->makeBuffer(nearest_.bytes());
    view.solid = solid_.address();
    stream_->fillZero(solid_, 0, bytesOfNearest(image_->size()));
  }
  stream_->fillZero(nearest_, 0, bytesOfNearest(image_->size()));
  stream_->upload(view_, 0, std::as_bytes(std::span(&view, 1)));
  drawParts(*stream_, pipeline, view_.address(), parts.ofBackground(), *background_, *more_);
  drawParts(*stream_, pipeline, view_.address(), parts.ofTiles(), *tiles_, *more_);
  stream_->copy(*image_, visible_, 0);
}

}  // namespace tessera
