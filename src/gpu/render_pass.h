// What an off-screen picture is drawn into: colour images and one of depth, what they hold at first, and what is kept.
// GpuStream::draw runs it. A render pass reads and leaves every image in GpuImage::kRestingLayout, so that it can be
// recorded once and sent again and again.
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

// The pixel formats of what is drawn into: a pipeline draws in those passes alone whose formats are its own.
struct AttachmentFormats {
  std::vector<ImageFormat> colours;  // by location of the fragment shader's outputs
  std::optional<ImageFormat> depth;
  bool operator==(const AttachmentFormats&) const = default;
};

// What an image holds when a pass begins.
enum class LoadOperation {
  clear,    // the clear value
  keep,     // what it held before, which must be something: a pass or a copy has written it
  discard,  // nothing defined: every pixel that is read afterwards is drawn
};

struct ColourAttachment {
  std::shared_ptr<const GpuImage> image;
  LoadOperation load = LoadOperation::clear;
  std::array<float, 4> clearColour = {};      // of formats that are not integers
  std::array<uint32_t, 4> clearInteger = {};  // of integers
  bool isStored = true;                       // else it has no contents after the pass
};

struct DepthAttachment {
  std::shared_ptr<const GpuImage> image;
  LoadOperation load = LoadOperation::clear;
  float clearDepth = 1;  // the far end; 0 where pipelines compare with `greater`
  bool isStored = true;
};

// Draws cover the whole images: Vulkan's clip space, (-1, -1) being the upper left corner, depth 0 to 1, pixel (0, 0)
// the first of the rows. Must not be destroyed while the device works on it (GpuStream::retire); its images live as
// long as it does.
class GpuRenderPass {
 public:
  // One image at least, all of one size, none twice. Throws Error where the device does not rasterise or has not so
  // many attachments.
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

  // A pass that pipelines of these formats are made for; to be destroyed by the caller. Throws Error.
  static VkRenderPass makeCompatible(const GpuContext& context, const AttachmentFormats& formats);

 private:
  friend class GpuStream;

  explicit GpuRenderPass(std::shared_ptr<const GpuContext> context) : context_(std::move(context)) {}
  void addAttachment(const GpuImage& image);
  // CHECKs that what is kept is there, and notes what there is afterwards.
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
