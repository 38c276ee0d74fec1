#include "gpu/image.h"

#include <fmt/format.h>

#include "base/check.h"
#include "base/error.h"
#include "gpu/call.h"

namespace tessera {

namespace {

struct FormatDescription {
  ImageFormat format;
  VkFormat vulkan;
  const char* name;
  uint32_t bytes;  // per pixel
};

constexpr FormatDescription kFormats[] = {
    {ImageFormat::rgba8, VK_FORMAT_R8G8B8A8_UNORM, "rgba8", 4},
    {ImageFormat::rgba16Float, VK_FORMAT_R16G16B16A16_SFLOAT, "rgba16-float", 8},
    {ImageFormat::r32Float, VK_FORMAT_R32_SFLOAT, "r32-float", 4},
    {ImageFormat::rgba32Float, VK_FORMAT_R32G32B32A32_SFLOAT, "rgba32-float", 16},
    {ImageFormat::r32Uint, VK_FORMAT_R32_UINT, "r32-uint", 4},
    {ImageFormat::rg32Uint, VK_FORMAT_R32G32_UINT, "rg32-uint", 8},
    {ImageFormat::depth32Float, VK_FORMAT_D32_SFLOAT, "depth32-float", 4},
};

const FormatDescription& describeFormat(ImageFormat format) {
  const FormatDescription& description = kFormats[static_cast<size_t>(format)];
  CHECK((description.format == format));
  return description;
}

}  // namespace

VkFormat vulkanFormat(ImageFormat format) {
  return describeFormat(format).vulkan;
}

const char* formatName(ImageFormat format) {
  return describeFormat(format).name;
}

uint32_t bytesPerPixel(ImageFormat format) {
  return describeFormat(format).bytes;
}

GpuImage::GpuImage(std::shared_ptr<const GpuContext> context, ImageSize size, ImageFormat format)
    : GpuImage(std::move(context)) {  // from here on the destructor cleans up
  CHECK(size.width > 0u);
  CHECK(size.height > 0u);
  context_->requireGraphics();
  size_ = size;
  format_ = format;
  serial_ = context_->nextSerial();
  const VkDevice device = context_->device();
  auto info = vulkanStruct<VkImageCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO);
  info.imageType = VK_IMAGE_TYPE_2D;
  info.format = vulkanFormat(format);
  info.extent = {size.width, size.height, 1};
  info.mipLevels = info.arrayLayers = 1;
  info.samples = VK_SAMPLE_COUNT_1_BIT;
  info.tiling = VK_IMAGE_TILING_OPTIMAL;
  info.usage = VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT |
               (isDepth(format) ? VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT : VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT);
  info.initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  requireSupport(info);
  checkVulkan(vkCreateImage(device, &info, nullptr, &image_), "vkCreateImage");
  piece_ = context_->heap().allocateImage(image_);
  checkVulkan(vkBindImageMemory(device, image_, piece_.memory, piece_.offset), "vkBindImageMemory");
  auto viewInfo = vulkanStruct<VkImageViewCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO);
  viewInfo.image = image_;
  viewInfo.viewType = VK_IMAGE_VIEW_TYPE_2D;
  viewInfo.format = info.format;
  viewInfo.subresourceRange = {aspect(), 0, 1, 0, 1};
  checkVulkan(vkCreateImageView(device, &viewInfo, nullptr, &view_), "vkCreateImageView");
}

GpuImage::~GpuImage() {
  if (view_) vkDestroyImageView(context_->device(), view_, nullptr);
  if (image_) vkDestroyImage(context_->device(), image_, nullptr);
  if (piece_.block) context_->heap().free(piece_);
}

void GpuImage::requireSupport(const VkImageCreateInfo& info) const {
  VkImageFormatProperties properties = {};
  const VkResult result = vkGetPhysicalDeviceImageFormatProperties(
      context_->physicalDevice(), info.format, info.imageType, info.tiling, info.usage, info.flags, &properties);
  if (result == VK_ERROR_FORMAT_NOT_SUPPORTED) {
    throw Error(context_->name(), "",
                fmt::format("it does not render into images of the format {}", formatName(format_)),
                "choose another device (tessera info devices)");
  }
  checkVulkan(result, "vkGetPhysicalDeviceImageFormatProperties");
  const VkExtent3D& maximum = properties.maxExtent;
  if (size_.width > maximum.width || size_.height > maximum.height) {
    throw Error(context_->name(), "",
                fmt::format("an image of {} x {} pixels is larger than its largest, {} x {}", size_.width, size_.height,
                            maximum.width, maximum.height),
                "render smaller images, or choose another device (tessera info devices)");
  }
  if (copiedBytes() > properties.maxResourceSize) {
    throw Error(context_->name(), "",
                fmt::format("an image of {} MiB is larger than its largest, {} MiB", copiedBytes() >> 20,
                            properties.maxResourceSize >> 20),
                "render smaller images, or choose another device (tessera info devices)");
  }
}

}  // namespace tessera
