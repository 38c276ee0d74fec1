// The images of a window, which the device draws and the screen shows in turn.
#pragma once

#include <volk.h>

#include <memory>
#include <vector>

#include "gpu/context.h"

namespace tessera {

class GpuSwapchain {
 public:
  // Takes the surface. The context was opened with GpuOptions::presents. Throws Error where the device cannot show
  // pictures on it.
  GpuSwapchain(std::shared_ptr<const GpuContext> context, VkSurfaceKHR surface);
  ~GpuSwapchain();  // the device must be idle
  GpuSwapchain(const GpuSwapchain&) = delete;
  GpuSwapchain& operator=(const GpuSwapchain&) = delete;

  // One colour attachment, cleared to black, left as the screen wants it.
  VkRenderPass renderPass() const { return renderPass_; }

  // Images anew, of the surface's size, or of this one where the surface leaves it to us. False where it has none: the
  // window is hidden. Waits for the device.
  bool remake(VkExtent2D wanted);
  bool isMade() const { return swapchain_ != VK_NULL_HANDLE; }

  VkExtent2D extent() const { return extent_; }
  bool isBlueFirst() const;  // of an image's bytes
  bool canBeRead() const { return canBeRead_; }

  struct Image {
    VkImage image = VK_NULL_HANDLE;
    VkImageView view = VK_NULL_HANDLE;
    VkFramebuffer framebuffer = VK_NULL_HANDLE;
    VkSemaphore drawn = VK_NULL_HANDLE;  // to be signalled by what is drawn
  };
  // The next one, which may be drawn once `available` is signalled.
  enum class Acquired { image, nothingYet, fitsNoMore };
  Acquired acquire(VkSemaphore available, uint32_t& index);
  const Image& image(uint32_t index) const { return images_[index]; }
  // Once its `drawn` is signalled. False: the images fit the window no more.
  bool present(uint32_t index);

 private:
  void chooseFormat();
  void makeRenderPass();
  void drop();

  std::shared_ptr<const GpuContext> context_;
  VkSurfaceKHR surface_;
  VkSurfaceFormatKHR format_ = {};
  VkRenderPass renderPass_ = VK_NULL_HANDLE;
  VkSwapchainKHR swapchain_ = VK_NULL_HANDLE;
  VkExtent2D extent_ = {};
  bool canBeRead_ = false;
  std::vector<Image> images_;
};

}  // namespace tessera
