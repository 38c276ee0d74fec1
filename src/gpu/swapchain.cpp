#include "gpu/swapchain.h"

#include <algorithm>

#include "base/error.h"
#include "gpu/call.h"

namespace tessera {

GpuSwapchain::GpuSwapchain(std::shared_ptr<const GpuContext> context, VkSurfaceKHR surface)
    : context_(std::move(context)), surface_(surface) {
  VkBool32 shows = VK_FALSE;
  const VkResult result =
      vkGetPhysicalDeviceSurfaceSupportKHR(context_->physicalDevice(), context_->queueFamily(), surface_, &shows);
  try {
    checkVulkan(result, "vkGetPhysicalDeviceSurfaceSupportKHR");
    if (!shows) {
      throw Error(context_->name(), "", "it cannot present images on this screen",
                  "choose the device that the screen is connected to (tessera info devices)");
    }
    context_->requireGraphics();
    chooseFormat();
    makeRenderPass();
  } catch (...) {
    vkDestroySurfaceKHR(context_->instance(), surface_, nullptr);
    throw;
  }
}

GpuSwapchain::~GpuSwapchain() {
  drop();
  if (swapchain_) vkDestroySwapchainKHR(context_->device(), swapchain_, nullptr);
  vkDestroyRenderPass(context_->device(), renderPass_, nullptr);
  vkDestroySurfaceKHR(context_->instance(), surface_, nullptr);
}

// Chooses a UNORM format: colours are sRGB already, so bytes are shown unchanged.
void GpuSwapchain::chooseFormat() {
  uint32_t count = 0;
  checkVulkan(vkGetPhysicalDeviceSurfaceFormatsKHR(context_->physicalDevice(), surface_, &count, nullptr),
              "vkGetPhysicalDeviceSurfaceFormatsKHR");
  std::vector<VkSurfaceFormatKHR> formats(count);
  checkVulkan(vkGetPhysicalDeviceSurfaceFormatsKHR(context_->physicalDevice(), surface_, &count, formats.data()),
              "vkGetPhysicalDeviceSurfaceFormatsKHR");
  for (const VkFormat preferred : {VK_FORMAT_B8G8R8A8_UNORM, VK_FORMAT_R8G8B8A8_UNORM}) {
    for (const VkSurfaceFormatKHR& format : formats) {
      if (format.format != preferred || format.colorSpace != VK_COLOR_SPACE_SRGB_NONLINEAR_KHR) continue;
      format_ = format;
      return;
    }
  }
  throw Error(context_->name(), "", "its screen does not support 8-bit sRGB images", "choose another screen");
}

void GpuSwapchain::makeRenderPass() {
  VkAttachmentDescription colour = {};
  colour.format = format_.format;
  colour.samples = VK_SAMPLE_COUNT_1_BIT;
  colour.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
  colour.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  colour.stencilLoadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  colour.stencilStoreOp = VK_ATTACHMENT_STORE_OP_DONT_CARE;
  colour.initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  colour.finalLayout = VK_IMAGE_LAYOUT_PRESENT_SRC_KHR;
  const VkAttachmentReference reference = {0, VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL};
  VkSubpassDescription subpass = {};
  subpass.pipelineBindPoint = VK_PIPELINE_BIND_POINT_GRAPHICS;
  subpass.colorAttachmentCount = 1;
  subpass.pColorAttachments = &reference;
  // The image may be drawn once the screen has released it (the semaphore waits at this stage), and copied afterwards.
  VkSubpassDependency before = {}, after = {};
  before.srcSubpass = VK_SUBPASS_EXTERNAL;
  before.srcStageMask = before.dstStageMask = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
  before.dstAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
  after.dstSubpass = VK_SUBPASS_EXTERNAL;
  after.srcStageMask = VK_PIPELINE_STAGE_COLOR_ATTACHMENT_OUTPUT_BIT;
  after.srcAccessMask = VK_ACCESS_COLOR_ATTACHMENT_WRITE_BIT;
  after.dstStageMask = VK_PIPELINE_STAGE_TRANSFER_BIT;
  after.dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
  const VkSubpassDependency dependencies[] = {before, after};
  auto info = vulkanStruct<VkRenderPassCreateInfo>(VK_STRUCTURE_TYPE_RENDER_PASS_CREATE_INFO);
  info.attachmentCount = 1;
  info.pAttachments = &colour;
  info.subpassCount = 1;
  info.pSubpasses = &subpass;
  info.dependencyCount = 2;
  info.pDependencies = dependencies;
  checkVulkan(vkCreateRenderPass(context_->device(), &info, nullptr, &renderPass_), "vkCreateRenderPass");
}

void GpuSwapchain::drop() {
  for (const Image& image : images_) {
    vkDestroySemaphore(context_->device(), image.drawn, nullptr);
    vkDestroyFramebuffer(context_->device(), image.framebuffer, nullptr);
    vkDestroyImageView(context_->device(), image.view, nullptr);
  }
  images_.clear();
}

bool GpuSwapchain::remake(VkExtent2D windowSize) {
  const VkDevice device = context_->device();
  checkVulkan(vkDeviceWaitIdle(device), "vkDeviceWaitIdle");
  drop();
  VkSurfaceCapabilitiesKHR can = {};
  checkVulkan(vkGetPhysicalDeviceSurfaceCapabilitiesKHR(context_->physicalDevice(), surface_, &can),
              "vkGetPhysicalDeviceSurfaceCapabilitiesKHR");
  constexpr uint32_t kAnySize = 0xffffffff;
  extent_ = can.currentExtent;
  if (extent_.width == kAnySize) {
    extent_ = {std::clamp(windowSize.width, can.minImageExtent.width, can.maxImageExtent.width),
               std::clamp(windowSize.height, can.minImageExtent.height, can.maxImageExtent.height)};
  }
  const VkSwapchainKHR old = swapchain_;
  swapchain_ = VK_NULL_HANDLE;
  VkResult result = VK_SUCCESS;
  const bool isSeen = extent_.width > 0 && extent_.height > 0;
  if (isSeen) {
    auto info = vulkanStruct<VkSwapchainCreateInfoKHR>(VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR);
    info.surface = surface_;
    info.minImageCount = can.minImageCount + 1;
    if (can.maxImageCount > 0) info.minImageCount = std::min(info.minImageCount, can.maxImageCount);
    info.imageFormat = format_.format;
    info.imageColorSpace = format_.colorSpace;
    info.imageExtent = extent_;
    info.imageArrayLayers = 1;
    canBeRead_ = (can.supportedUsageFlags & VK_IMAGE_USAGE_TRANSFER_SRC_BIT) != 0;
    info.imageUsage = VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT | (canBeRead_ ? VK_IMAGE_USAGE_TRANSFER_SRC_BIT : 0);
    info.preTransform = can.currentTransform;
    info.compositeAlpha = VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR;
    for (const VkCompositeAlphaFlagBitsKHR alpha :
         {VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR, VK_COMPOSITE_ALPHA_INHERIT_BIT_KHR}) {
      if ((can.supportedCompositeAlpha & alpha) == 0) continue;
      info.compositeAlpha = alpha;
      break;
    }
    info.presentMode = VK_PRESENT_MODE_FIFO_KHR;  // vertical synchronisation; the only mode that is always supported
    info.clipped = VK_TRUE;
    info.oldSwapchain = old;
    result = vkCreateSwapchainKHR(device, &info, nullptr, &swapchain_);
  }
  if (old) vkDestroySwapchainKHR(device, old, nullptr);
  checkVulkan(result, "vkCreateSwapchainKHR");
  if (!isSeen) return false;

  uint32_t count = 0;
  checkVulkan(vkGetSwapchainImagesKHR(device, swapchain_, &count, nullptr), "vkGetSwapchainImagesKHR");
  std::vector<VkImage> handles(count);
  checkVulkan(vkGetSwapchainImagesKHR(device, swapchain_, &count, handles.data()), "vkGetSwapchainImagesKHR");
  for (const VkImage handle : handles) {
    Image& image = images_.emplace_back();
    image.image = handle;
    auto view = vulkanStruct<VkImageViewCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO);
    view.image = handle;
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = format_.format;
    view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, 1};
    checkVulkan(vkCreateImageView(device, &view, nullptr, &image.view), "vkCreateImageView");
    auto framebuffer = vulkanStruct<VkFramebufferCreateInfo>(VK_STRUCTURE_TYPE_FRAMEBUFFER_CREATE_INFO);
    framebuffer.renderPass = renderPass_;
    framebuffer.attachmentCount = 1;
    framebuffer.pAttachments = &image.view;
    framebuffer.width = extent_.width;
    framebuffer.height = extent_.height;
    framebuffer.layers = 1;
    checkVulkan(vkCreateFramebuffer(device, &framebuffer, nullptr, &image.framebuffer), "vkCreateFramebuffer");
    const auto semaphore = vulkanStruct<VkSemaphoreCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO);
    checkVulkan(vkCreateSemaphore(device, &semaphore, nullptr, &image.drawn), "vkCreateSemaphore");
  }
  return true;
}

bool GpuSwapchain::isBlueFirst() const {
  return format_.format == VK_FORMAT_B8G8R8A8_UNORM;
}

// A window that is not visible may have no next image for a long time, so the wait is limited.
GpuSwapchain::Acquired GpuSwapchain::acquire(VkSemaphore available, uint32_t& index) {
  constexpr uint64_t kLongest = 200'000'000;  // nanoseconds
  const VkResult result =
      vkAcquireNextImageKHR(context_->device(), swapchain_, kLongest, available, VK_NULL_HANDLE, &index);
  if (result == VK_ERROR_OUT_OF_DATE_KHR) return Acquired::fitsNoMore;
  checkVulkan(result, "vkAcquireNextImageKHR");
  if (result == VK_TIMEOUT || result == VK_NOT_READY) return Acquired::nothingYet;
  return Acquired::image;  // also if VK_SUBOPTIMAL_KHR: `present` reports it again
}

bool GpuSwapchain::present(uint32_t index) {
  auto info = vulkanStruct<VkPresentInfoKHR>(VK_STRUCTURE_TYPE_PRESENT_INFO_KHR);
  info.waitSemaphoreCount = 1;
  info.pWaitSemaphores = &images_[index].drawn;
  info.swapchainCount = 1;
  info.pSwapchains = &swapchain_;
  info.pImageIndices = &index;
  const VkResult result = vkQueuePresentKHR(context_->queue(), &info);
  if (result == VK_ERROR_OUT_OF_DATE_KHR || result == VK_SUBOPTIMAL_KHR) return false;
  checkVulkan(result, "vkQueuePresentKHR");
  return true;
}

}  // namespace tessera
