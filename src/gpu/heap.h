// Device memory, taken in large blocks and given out in pieces: drivers allow a few thousand allocations in all, and
// each is a call to the kernel. Images have blocks apart from those of buffers (bufferImageGranularity). For several
// threads.
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
  device,    // the device's own memory; the host reaches it by copies only
  upload,    // the host writes, the device reads: mapped, device memory too where the host can reach that
  download,  // the device writes, the host reads: mapped, cached where possible
};

class GpuHeap {
 public:
  // `context` owns the heap and is there for longer.
  explicit GpuHeap(const GpuContext& context);
  ~GpuHeap();
  GpuHeap(const GpuHeap&) = delete;
  GpuHeap& operator=(const GpuHeap&) = delete;

  struct Block;
  struct Piece {
    Block* block = nullptr;
    VkBuffer buffer = VK_NULL_HANDLE;        // of the whole block; none for images
    size_t offset = 0;                       // in it, and in its memory
    VkDeviceAddress address = 0;             // of the piece; 0 for images
    std::byte* mapped = nullptr;             // likewise; null for BufferUse::device and for images
    size_t room = 0;                         // of the piece, at least what was asked for
    VkDeviceMemory memory = VK_NULL_HANDLE;  // of the whole block
  };
  // Throws Error when memory is short, saying how much is in use.
  Piece allocate(size_t bytes, BufferUse use);
  // The device's own memory for an image that is not bound to any yet. Throws Error likewise.
  Piece allocateImage(VkImage image);
  void free(const Piece& piece);

  size_t bytesInUse() const;  // by buffers and images
  size_t blockCount() const;
  // Rises whenever a block is given back to the driver: handles may then mean something else.
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
    size_t room;              // bytes
    uint32_t typeBits = ~0u;  // the memory types that serve
    bool mayShare = true;     // a block with others
  };
  // A piece of one of the blocks, else of one more that `make` makes.
  Piece take(Blocks& blocks, const Request& request, const MakeBlock& make);

  const GpuContext& context_;
  mutable std::mutex mutex_;
  std::array<Blocks, 4> blocks_;  // of buffers by use, then of images
  size_t inUse_ = 0;
  uint64_t generation_ = 1;
};

}  // namespace tessera
