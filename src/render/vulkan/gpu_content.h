// A content in GPU memory, addressed by device addresses.
#pragma once

#include <memory>

#include "gpu/stream.h"
#include "render/vulkan/packed_content.h"

namespace tessera {

class GpuContent {
 public:
  GpuContent() = default;
  GpuContent(const GpuContent&) = delete;
  GpuContent& operator=(const GpuContent&) = delete;
  virtual ~GpuContent() = default;

  // GPU memory in bytes, without shared resources.
  virtual uint64_t memoryBytes() const = 0;
};

// A GPU buffer that is destroyed once the GPU has finished all work that uses it.
class GpuContentMemory {
 public:
  GpuContentMemory() = default;
  GpuContentMemory(std::shared_ptr<GpuStream> stream, size_t bytes)
      : stream_(std::move(stream)), buffer_(stream_->makeBuffer(bytes)) {}
  ~GpuContentMemory() {
    if (buffer_) stream_->deferDestroy(std::move(buffer_));
  }
  GpuContentMemory(GpuContentMemory&& other) noexcept { *this = std::move(other); }
  GpuContentMemory& operator=(GpuContentMemory&& other) noexcept {
    std::swap(stream_, other.stream_);
    std::swap(buffer_, other.buffer_);
    return *this;
  }

  void upload(const PackedContent& packed) { stream_->upload(buffer_, 0, packed.bytes()); }
  uint64_t address() const { return buffer_.address(); }
  size_t bytes() const { return buffer_.bytes(); }

 private:
  std::shared_ptr<GpuStream> stream_;
  GpuBuffer buffer_;
};

}  // namespace tessera
