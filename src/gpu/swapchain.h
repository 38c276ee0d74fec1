// The swapchain of a window: the images that the device draws and the screen shows in turn.
#pragma once

#include <volk.h>

#include <memory>
#include <vector>

#include "gpu/context.h"

namespace tessera {

class GpuSwapchain {
 public:
  // Takes ownership of the surface. The context must have been opened with GpuOptions::presents. Throws Error if the
  // device cannot present to the surface.
  GpuSwapchain(std::shared_ptr<const GpuContext> context, VkSurfaceKHR surface);
  ~GpuSwapchain();  // the device must be idle
  GpuSwapchain(const GpuSwapchain&) = delete;
  GpuSwapchain& operator=(const GpuSwapchain&) = delete;

  // The pass has one colour attachment, which it clears to black and leaves in the layout for presentation.
  VkRenderPass renderPass() const { return renderPass_; }

  // Recreates the images with the surface's size, or with `windowSize` if the surface does not define one. Returns
  // false if the size is zero because the window is hidden. Waits for the device.
  bool remake(VkExtent2D windowSize);
  bool isMade() const { return swapchain_ != VK_NULL_HANDLE; }

  VkExtent2D extent() const { return extent_; }
  bool isBlueFirst() const;  // the byte order of a pixel: BGRA instead of RGBA
  bool canBeRead() const { return canBeRead_; }

  struct Image {
    VkImage image = VK_NULL_HANDLE;
    VkImageView view = VK_NULL_HANDLE;
    VkFramebuffer framebuffer = VK_NULL_HANDLE;
    VkSemaphore drawn = VK_NULL_HANDLE;  // to be signalled by the commands that draw the image
  };
  enum class Acquired {
    image,
    nothingYet,  // no image became free in time; try again
    fitsNoMore,  // the images no longer match the window: call remake()
  };
  // Acquires the next image, which may be drawn once `available` is signalled, and stores its index. Throws Error if
  // the device is lost.
  Acquired acquire(VkSemaphore available, uint32_t& index);
  const Image& image(uint32_t index) const { return images_[index]; }
  // Presents an image once its `drawn` is signalled. Returns false if the images no longer match the window.
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
