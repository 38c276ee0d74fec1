// Pictures of a window, one after another: what is drawn into each, and showing it. Work that a GpuStream of the same
// context has sent before `end` is done before the picture is drawn, and what it sends afterwards begins when the
// picture is. For the thread that uses that stream.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "base/image.h"
#include "gpu/buffer.h"
#include "gpu/screen_pipeline.h"
#include "gpu/swapchain.h"

namespace tessera {

class GpuPresenter {
 public:
  // Takes the surface (GpuSwapchain).
  GpuPresenter(std::shared_ptr<const GpuContext> context, VkSurfaceKHR surface);
  ~GpuPresenter();  // waits
  GpuPresenter(const GpuPresenter&) = delete;
  GpuPresenter& operator=(const GpuPresenter&) = delete;

  VkRenderPass renderPass() const { return swapchain_.renderPass(); }

  // Begins a picture of a window of this size; waits until the device has done with the last but one. False where there
  // is nothing to draw into now: the window is hidden, or just being resized.
  bool begin(VkExtent2D window);
  VkExtent2D extent() const { return swapchain_.extent(); }
  // Copies bytes to where shaders reach them until the picture is drawn → address, a multiple of 16.
  VkDeviceAddress stage(std::span<const std::byte> bytes);
  // Draws triangles of so many vertices (gl_VertexIndex from 0), only where `where` says.
  void draw(const GpuScreenPipeline& pipeline, std::span<const std::byte> arguments, uint32_t vertices,
            const VkRect2D& where);
  // Shows the picture. With `wanted`, waits, and gives it its colours; throws Error where the screen does not let them
  // go.
  void end(ImageU8* wanted = nullptr);

 private:
  struct Frame {
    VkCommandBuffer commands = VK_NULL_HANDLE;
    VkSemaphore available = VK_NULL_HANDLE;
    VkFence drawn = VK_NULL_HANDLE;
    std::vector<GpuBuffer> staging;
    size_t buffer = 0, staged = 0;  // the buffer of `staging` in use, and bytes of it
  };
  void read(const GpuSwapchain::Image& image, const GpuBuffer& to);

  std::shared_ptr<const GpuContext> context_;
  GpuSwapchain swapchain_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  std::array<Frame, 2> frames_;
  int current_ = 0;
  uint32_t image_ = 0;
  bool fits_ = false;  // the images fit the window
  VkExtent2D window_ = {};
};

}  // namespace tessera
