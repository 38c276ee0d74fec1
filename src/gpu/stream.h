// Work for the device, in order: copies, fills and kernels are recorded and sent in batches; each sees all that came
// before it. Only `download` and `finish` wait. For one thread at a time.
#pragma once

#include <vulkan/vulkan.h>

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "gpu/buffer.h"
#include "gpu/kernel.h"

namespace tessera {

struct Groups {
  uint32_t x = 1, y = 1, z = 1;
};

class GpuStream {
 public:
  // `stagingBytes` is what one batch can carry of uploads and kernel arguments; larger uploads take several batches.
  explicit GpuStream(std::shared_ptr<const GpuContext> context, size_t stagingBytes = size_t{4} << 20);
  ~GpuStream();  // waits
  GpuStream(const GpuStream&) = delete;
  GpuStream& operator=(const GpuStream&) = delete;

  void upload(const GpuBuffer& to, size_t offset, std::span<const std::byte> bytes);
  void download(const GpuBuffer& from, size_t offset, std::span<std::byte> bytes);  // waits
  void fillZero(const GpuBuffer& buffer, size_t offset, size_t bytes);              // multiples of 4
  // Copies `arguments` and runs the kernel with their address. No groups, no work.
  void run(const GpuKernel& kernel, std::span<const std::byte> arguments, Groups groups);
  void finish();
  // Destroys the buffer once nothing queued so far can touch it.
  void retire(GpuBuffer buffer);

  const std::shared_ptr<const GpuContext>& context() const { return context_; }

 private:
  struct Batch {
    VkCommandBuffer commands = VK_NULL_HANDLE;
    VkFence done = VK_NULL_HANDLE;
    GpuBuffer staging;
    size_t staged = 0;
    int recorded = 0;        // commands since `begin`
    bool submitted = false;  // and not yet waited for
    std::vector<GpuBuffer> retired;
  };

  Batch& recording() { return batches_[current_]; }
  void begin();
  void submit();  // sends the batch, and begins the next one
  void wait(Batch& batch);
  void beforeCommand();                            // makes all earlier results visible to the next command
  size_t stage(std::span<const std::byte> bytes);  // → offset in the staging buffer; the bytes must fit

  std::shared_ptr<const GpuContext> context_;
  size_t stagingBytes_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  std::array<Batch, 2> batches_;  // one is recorded while the device works on the other
  int current_ = 0;
  GpuBuffer downloads_;
};

}  // namespace tessera
