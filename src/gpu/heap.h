// The device memory allocator. It allocates large blocks and suballocates them: drivers allow only a few thousand
// allocations in total, and each is a system call. Images and buffers have separate blocks (bufferImageGranularity).
// Thread-safe.
#pragma once

#include <volk.h>

#include <array>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

namespace tessera {

class GpuContext;

enum class BufferUse {
  device,    // device-local memory; the host accesses it by copies only
  upload,    // the host writes, the device reads: mapped, and device-local if the host can map that
  download,  // the device writes, the host reads: mapped, cached if possible
};

class GpuHeap {
 public:
  // `context` owns the heap and outlives it.
  explicit GpuHeap(const GpuContext& context);
  ~GpuHeap();
  GpuHeap(const GpuHeap&) = delete;
  GpuHeap& operator=(const GpuHeap&) = delete;

  struct Block;
  struct Piece {
    Block* block = nullptr;
    VkBuffer buffer = VK_NULL_HANDLE;        // of the whole block; null for images
    size_t offset = 0;                       // in the block's buffer and memory, bytes
    VkDeviceAddress address = 0;             // of the piece; 0 for images
    std::byte* mapped = nullptr;             // of the piece; null for BufferUse::device and for images
    size_t capacity = 0;                     // of the piece in bytes, at least the requested size
    VkDeviceMemory memory = VK_NULL_HANDLE;  // of the whole block
  };
  // Throws Error if memory is insufficient; the error states how much is in use.
  Piece allocate(size_t bytes, BufferUse use);
  // Allocates device-local memory for an image that is not bound yet. Throws Error if memory is insufficient.
  Piece allocateImage(VkImage image);
  void free(const Piece& piece);

  size_t bytesInUse() const;  // by buffers and images
  size_t blockCount() const;
  // Increases whenever a block is freed: the driver may then reuse its handles.
  uint64_t generation() const;

 private:
  static constexpr size_t kBlockBytes = size_t{64} << 20;
  static constexpr size_t kAlignment = 256;
  static constexpr size_t kImageAlignment = size_t{64} << 10;

  std::unique_ptr<Block> makeBufferBlock(size_t bytes, BufferUse use) const;
  std::unique_ptr<Block> makeImageBlock(const VkMemoryRequirements& needs) const;
  void allocateMemory(Block& block, const VkMemoryRequirements& needs, BufferUse use, const void* next) const;
  using Blocks = std::vector<std::unique_ptr<Block>>;
  using MakeBlock = std::function<std::unique_ptr<Block>(size_t bytes)>;
  struct Request {
    size_t capacity;          // bytes
    uint32_t typeBits = ~0u;  // the acceptable memory types
    bool mayShare = true;     // a block with other pieces
  };
  // Returns a piece of one of the blocks, or of a new block, which `make` creates, if none has enough space.
  Piece take(Blocks& blocks, const Request& request, const MakeBlock& make);

  const GpuContext& context_;
  mutable std::mutex mutex_;
  std::array<Blocks, 4> blocks_;  // of buffers by use (BufferUse), then of images
  size_t inUse_ = 0;
  uint64_t generation_ = 1;
};

}  // namespace tessera
