// Two-dimensional off-screen images: the attachments of render passes (gpu/render_pass.h). Shaders access them as
// attachments only; kernels and the host access copies of them in buffers (GpuStream::copy).
#pragma once

#include <volk.h>

#include <cstdint>
#include <memory>

#include "gpu/context.h"
#include "gpu/heap.h"

namespace tessera {

enum class ImageFormat {
  rgba8,        // four bytes, each 0 to 1
  rgba16Float,  // four fp16
  r32Float,
  rgba32Float,
  r32Uint,
  rg32Uint,      // for visibility buffers: an object and a triangle, for example
  depth32Float,  // 0 to 1
};

VkFormat vulkanFormat(ImageFormat format);
const char* formatName(ImageFormat format);
uint32_t bytesPerPixel(ImageFormat format);
inline bool isDepth(ImageFormat format) {
  return format == ImageFormat::depth32Float;
}
inline bool isInteger(ImageFormat format) {
  return format == ImageFormat::r32Uint || format == ImageFormat::rg32Uint;
}

struct ImageSize {
  uint32_t width = 0, height = 0;  // pixels, at least 1
  bool operator==(const ImageSize&) const = default;
};

// An image with one mip level, one layer and one sample per pixel. The contents are undefined at first. Between the
// commands of a stream, an image that has contents is always in kRestingLayout, so that recorded commands are valid
// whatever precedes them. An image must not be destroyed while the device uses it; see GpuStream::deferDestroy.
class GpuImage {
 public:
  // Throws Error if the device does not rasterise, does not support attachments of this format or size, or has
  // insufficient memory.
  GpuImage(std::shared_ptr<const GpuContext> context, ImageSize size, ImageFormat format);
  ~GpuImage();
  GpuImage(const GpuImage&) = delete;
  GpuImage& operator=(const GpuImage&) = delete;

  ImageSize size() const { return size_; }
  ImageFormat format() const { return format_; }
  // The size of a copy in a buffer, in bytes: [height][width] pixels without padding.
  size_t copiedBytes() const { return size_t{size_.width} * size_.height * bytesPerPixel(format_); }
  size_t memoryBytes() const { return piece_.capacity; }  // allocated from the heap

  VkImage handle() const { return image_; }
  VkImageView view() const { return view_; }
  VkImageAspectFlags aspect() const { return isDepth(format_) ? VK_IMAGE_ASPECT_DEPTH_BIT : VK_IMAGE_ASPECT_COLOR_BIT; }
  uint64_t serial() const { return serial_; }  // GpuContext::nextSerial

  static constexpr VkImageLayout kRestingLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;

 private:
  friend class GpuRenderPass;
  friend class GpuStream;

  explicit GpuImage(std::shared_ptr<const GpuContext> context) : context_(std::move(context)) {}
  void requireSupport(const VkImageCreateInfo& info) const;

  std::shared_ptr<const GpuContext> context_;
  ImageSize size_;
  ImageFormat format_ = ImageFormat::rgba8;
  VkImage image_ = VK_NULL_HANDLE;
  VkImageView view_ = VK_NULL_HANDLE;
  GpuHeap::Piece piece_;
  uint64_t serial_ = 0;
  mutable bool hasContents_ = false;  // after the commands queued so far
};

}  // namespace tessera
