// A range of device memory with its own address. Kernels access it by pointer, never through descriptors.
#pragma once

#include <cstddef>
#include <memory>

#include "gpu/context.h"
#include "gpu/heap.h"

namespace tessera {

// The contents are undefined at first. Move-only. A buffer must not be destroyed while the device uses it; see
// GpuStream::deferDestroy.
class GpuBuffer {
 public:
  GpuBuffer() = default;
  // Throws Error if memory is insufficient.
  GpuBuffer(std::shared_ptr<const GpuContext> context, size_t bytes, BufferUse use = BufferUse::device);
  ~GpuBuffer();
  GpuBuffer(GpuBuffer&& other) noexcept { *this = std::move(other); }
  GpuBuffer& operator=(GpuBuffer&& other) noexcept;

  explicit operator bool() const { return piece_.block != nullptr; }
  // The Vulkan buffer that contains this range, and the offset of the range in it in bytes: for copy commands.
  VkBuffer handle() const { return piece_.buffer; }
  size_t offset() const { return piece_.offset; }
  VkDeviceAddress address() const { return piece_.address; }
  size_t bytes() const { return bytes_; }
  std::byte* mapped() const { return piece_.mapped; }  // null for BufferUse::device

 private:
  std::shared_ptr<const GpuContext> context_;
  GpuHeap::Piece piece_;
  size_t bytes_ = 0;
};

}  // namespace tessera
