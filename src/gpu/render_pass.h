// An off-screen render pass: its colour and depth images, their contents at the beginning, and whether the results are
// stored. GpuStream::draw runs it. A render pass expects and leaves every image in GpuImage::kRestingLayout, so that it
// can be recorded once and submitted many times.
#pragma once

#include <volk.h>

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "gpu/context.h"
#include "gpu/image.h"

namespace tessera {

// The formats of a pass's attachments. A pipeline can only draw in passes with the same formats.
struct AttachmentFormats {
  std::vector<ImageFormat> colours;  // by location of the fragment shader's outputs
  std::optional<ImageFormat> depth;
  bool operator==(const AttachmentFormats&) const = default;
};

// The contents of an image when a pass begins.
enum class LoadOperation {
  clear,    // the clear value
  keep,     // the previous contents, which must be defined: written by a pass or a copy
  discard,  // undefined: every pixel that is read afterwards must be drawn
};

struct ColourAttachment {
  std::shared_ptr<const GpuImage> image;
  LoadOperation load = LoadOperation::clear;
  std::array<float, 4> clearColour = {};      // for formats that are not integers
  std::array<uint32_t, 4> clearInteger = {};  // for integer formats
  bool isStored = true;                       // if false, the image has no contents after the pass
};

struct DepthAttachment {
  std::shared_ptr<const GpuImage> image;
  LoadOperation load = LoadOperation::clear;
  float clearDepth = 1;  // the far end; 0 if the pipelines compare with `greater`
  bool isStored = true;
};

// The viewport covers the whole images. Coordinates are Vulkan's clip space: (-1, -1) is the upper left corner, depth
// is 0 to 1, and pixel (0, 0) is the first of the first row. A pass must not be destroyed while the device uses it; see
// GpuStream::deferDestroy. It shares the ownership of its images.
class GpuRenderPass {
 public:
  // Requires at least one image; all have the same size, and none may appear twice. Throws Error if the device does not
  // rasterise or does not support this number or size of attachments.
  GpuRenderPass(std::shared_ptr<const GpuContext> context, std::vector<ColourAttachment> colours,
                std::optional<DepthAttachment> depth = std::nullopt);
  ~GpuRenderPass();
  GpuRenderPass(const GpuRenderPass&) = delete;
  GpuRenderPass& operator=(const GpuRenderPass&) = delete;

  ImageSize size() const { return size_; }
  const AttachmentFormats& formats() const { return formats_; }
  VkRenderPass handle() const { return pass_; }
  VkFramebuffer framebuffer() const { return framebuffer_; }
  std::span<const VkClearValue> clearValues() const { return clearValues_; }
  uint64_t serial() const { return serial_; }  // GpuContext::nextSerial

  // Creates a pass that is compatible with pipelines of these formats. The caller must destroy it. Throws Error
  // if the device does not rasterise or does not support this number of attachments, or if the driver cannot create the
  // pass.
  static VkRenderPass makeCompatible(const GpuContext& context, const AttachmentFormats& formats);

 private:
  friend class GpuStream;

  explicit GpuRenderPass(std::shared_ptr<const GpuContext> context) : context_(std::move(context)) {}
  void addAttachment(const GpuImage& image);
  // CHECKs that images with LoadOperation::keep have contents, and records which images have contents afterwards.
  void noteContents() const;

  std::shared_ptr<const GpuContext> context_;
  std::vector<ColourAttachment> colours_;
  std::optional<DepthAttachment> depth_;
  ImageSize size_;
  AttachmentFormats formats_;
  VkRenderPass pass_ = VK_NULL_HANDLE;
  VkFramebuffer framebuffer_ = VK_NULL_HANDLE;
  std::vector<VkImageView> views_;
  std::vector<VkClearValue> clearValues_;
  uint64_t serial_ = 0;
};

}  // namespace tessera
