// One piece of device memory with its own address: kernels reach it by pointer, never through descriptors.
#pragma once

#include <vulkan/vulkan.h>

#include <cstddef>
#include <memory>

#include "gpu/context.h"

namespace tessera {

enum class BufferUse {
  device,    // the device's own memory; the host reaches it by copies only
  upload,    // the host writes, the device reads: mapped, device memory too where the host can reach that
  download,  // the device writes, the host reads: mapped, cached where possible
};

// Contents are undefined at first. Move only. Must not be destroyed while the device works on it (GpuStream::retire).
class GpuBuffer {
 public:
  GpuBuffer() = default;
  // Throws Error when memory is short.
  GpuBuffer(std::shared_ptr<const GpuContext> context, size_t bytes, BufferUse use = BufferUse::device);
  ~GpuBuffer() { destroy(); }
  GpuBuffer(GpuBuffer&& other) noexcept { *this = std::move(other); }
  GpuBuffer& operator=(GpuBuffer&& other) noexcept;

  explicit operator bool() const { return buffer_ != VK_NULL_HANDLE; }
  VkBuffer handle() const { return buffer_; }
  VkDeviceAddress address() const { return address_; }
  size_t bytes() const { return bytes_; }
  std::byte* mapped() const { return mapped_; }  // null for BufferUse::device

 private:
  void destroy();

  std::shared_ptr<const GpuContext> context_;
  VkBuffer buffer_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  VkDeviceAddress address_ = 0;
  size_t bytes_ = 0;
  std::byte* mapped_ = nullptr;
};

}  // namespace tessera
