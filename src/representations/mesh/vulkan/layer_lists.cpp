#include "representations/mesh/vulkan/layer_lists.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "base/error.h"
#include "shaders/list_layers.h"
#include "shaders/patch_triangles.h"

namespace tessera {
namespace {

constexpr uint32_t kFirstLayers = 8;    // of each pixel, for which there is memory at first
constexpr uint64_t kShareOfMemory = 8;  // the lists take at most one part of as many

GraphicsPipelineOptions listingOptions() {
  GraphicsPipelineOptions options;
  options.depth = ImageFormat::depth32Float;
  options.depthTest = options.depthWrite = false;
  options.fragmentStores = true;
  return options;
}

}  // namespace

LayerLists::LayerLists(std::shared_ptr<GpuStream> stream, uint32_t largestCapacity)
    : stream_(std::move(stream)), largestCapacity_(largestCapacity) {
  if (largestCapacity_ > 0) return;
  const GpuContext& context = *stream_->context();
  const uint64_t bytes = std::min(context.memoryBytes() / kShareOfMemory, context.largestAllocation());
  largestCapacity_ = static_cast<uint32_t>(
      std::min<uint64_t>(bytes / sizeof(arguments::LayerNode), std::numeric_limits<uint32_t>::max() - 1));
}

LayerLists::~LayerLists() {
  if (pass_) stream_->deferDestroy(std::move(pass_));
  for (GpuBuffer* buffer : {&heads_, &nodes_, &counter_, &view_})
    if (*buffer) stream_->deferDestroy(std::move(*buffer));
}

void LayerLists::ensureRaster(ImageSize size) {
  const std::shared_ptr<const GpuContext>& context = stream_->context();
  if (!pipeline_) {
    pipeline_ =
        std::make_unique<GpuGraphicsPipeline>(context, kPatchTrianglesSpirv, kListLayersSpirv, listingOptions());
    counter_ = stream_->makeBuffer(sizeof(uint32_t));
    view_ = stream_->makeBuffer(sizeof(arguments::MeshViewArguments));
  }
  if (pass_ && pass_->size() == size) return;
  if (pass_) stream_->deferDestroy(std::move(pass_));
  pass_ = std::make_shared<GpuRenderPass>(context, std::vector<ColourAttachment>{},
                                          DepthAttachment{.image = stream_->makeImage(size, ImageFormat::depth32Float),
                                                          .load = LoadOperation::discard,
                                                          .isStored = false});
  const size_t bytes = size_t{size.width} * size.height * sizeof(uint32_t);
  if (heads_.bytes() < bytes) {
    if (heads_) stream_->deferDestroy(std::move(heads_));
    heads_ = GpuBuffer();
    heads_ = stream_->makeBuffer(bytes);
  }
}

void LayerLists::ensureCapacity(uint32_t fragments) {
  fragments = std::clamp(fragments, 1u, largestCapacity_);
  if (capacity_ >= fragments) return;
  if (nodes_) stream_->deferDestroy(std::move(nodes_));
  nodes_ = GpuBuffer();
  capacity_ = 0;
  nodes_ = stream_->makeBuffer(size_t{fragments} * sizeof(arguments::LayerNode));
  capacity_ = fragments;
}

uint32_t LayerLists::list(const arguments::MeshViewArguments& view, std::span<const DrawnPart> parts) {
  stream_->upload(view_, 0, std::as_bytes(std::span(&view, 1)));
  stream_->fillZero(counter_, 0, sizeof(uint32_t));
  stream_->fillZero(heads_, 0, size_t{view.raster.width} * view.raster.height * sizeof(uint32_t));
  drawParts(*stream_, *pipeline_, view_.address(), parts, *pass_, *pass_);
  uint32_t fragments = 0;
  stream_->download(counter_, 0, std::as_writable_bytes(std::span(&fragments, 1)));
  return fragments;
}

void LayerLists::draw(arguments::MeshViewArguments view, std::span<const DrawnPart> parts,
                      const std::function<void(const arguments::MeshViewArguments&)>& composite) {
  ensureRaster({view.raster.width, view.raster.height});
  const uint64_t pixels = uint64_t{view.raster.width} * view.raster.height;
  ensureCapacity(static_cast<uint32_t>(std::min<uint64_t>(kFirstLayers * pixels, largestCapacity_)));
  std::vector<std::pair<uint32_t, uint32_t>> rows = {{0, view.raster.height - 1}};
  while (!rows.empty()) {
    const auto [firstRow, lastRow] = rows.back();
    view.lists = {heads_.address(), counter_.address(), nodes_.address(), capacity_, firstRow, lastRow, 0};
    const uint32_t fragments = list(view, parts);
    if (fragments > capacity_) {
      if (capacity_ < largestCapacity_) {
        // A quarter more, because the next view may show more.
        ensureCapacity(static_cast<uint32_t>(std::min<uint64_t>(fragments * uint64_t{5} / 4, largestCapacity_)));
        continue;
      }
      if (firstRow == lastRow) {
        throw Error(fmt::format("image of {}x{}", view.view.width, view.view.height), "",
                    "shows more triangles in one row of pixels than fit into GPU memory",
                    "ask for a smaller one, or use --device cpu");
      }
      const uint32_t middle = firstRow + (lastRow - firstRow) / 2;
      rows.back() = {middle + 1, lastRow};
      rows.emplace_back(firstRow, middle);
      continue;
    }
    rows.pop_back();
    composite(view);
  }
}

}  // namespace tessera
