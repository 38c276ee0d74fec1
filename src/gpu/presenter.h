// Draws and presents the frames of a window. Work that a GpuStream of the same context has submitted before `end` is
// completed before the frame is drawn, and work that it submits afterwards begins after the frame is drawn. It must be
// used by the thread that uses that stream.
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
  // Takes ownership of the surface (GpuSwapchain).
  GpuPresenter(std::shared_ptr<const GpuContext> context, VkSurfaceKHR surface);
  ~GpuPresenter();  // waits for the device
  GpuPresenter(const GpuPresenter&) = delete;
  GpuPresenter& operator=(const GpuPresenter&) = delete;

  VkRenderPass renderPass() const { return swapchain_.renderPass(); }

  // Begins a frame of a window of this size; waits until the device has finished the last frame but one. Returns false
  // if there is no image to draw into: the window is hidden or being resized.
  bool begin(VkExtent2D window);
  VkExtent2D extent() const { return swapchain_.extent(); }
  // Copies bytes to memory that shaders can access until the frame is drawn. Returns its address, a multiple of 16.
  VkDeviceAddress stage(std::span<const std::byte> bytes);
  // Draws triangles with `vertices` vertices (gl_VertexIndex from 0), clipped to the rectangle `where`.
  void draw(const GpuScreenPipeline& pipeline, std::span<const std::byte> arguments, uint32_t vertices,
            const VkRect2D& where);
  // Presents the frame. If `screenshot` is not null, waits and stores the colours of the frame in it; throws Error if
  // the surface does not support reading them.
  void end(ImageU8* screenshot = nullptr);

 private:
  struct Frame {
    VkCommandBuffer commands = VK_NULL_HANDLE;
    VkSemaphore available = VK_NULL_HANDLE;
    VkFence drawn = VK_NULL_HANDLE;
    std::vector<GpuBuffer> staging;
    size_t buffer = 0, staged = 0;  // index in `staging` of the buffer in use, and the bytes used of it
  };
  void read(const GpuSwapchain::Image& image, const GpuBuffer& to);

  std::shared_ptr<const GpuContext> context_;
  GpuSwapchain swapchain_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  std::array<Frame, 2> frames_;
  int current_ = 0;
  uint32_t image_ = 0;
  bool fits_ = false;  // the swapchain's images match the window's size
  VkExtent2D window_ = {};
};

}  // namespace tessera
