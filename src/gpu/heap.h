// Device memory, taken in large blocks and given out in pieces: drivers allow a few thousand allocations in all, and
// each is a call to the kernel. For several threads.
#pragma once

#include <volk.h>

#include <array>
#include <cstddef>
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
    VkBuffer buffer = VK_NULL_HANDLE;  // of the whole block
    size_t offset = 0;                 // in it
    VkDeviceAddress address = 0;       // of the piece
    std::byte* mapped = nullptr;       // likewise; null for BufferUse::device
    size_t room = 0;                   // of the piece, at least what was asked for
  };
  // Throws Error when memory is short, saying how much is in use.
  Piece allocate(size_t bytes, BufferUse use);
  void free(const Piece& piece);

  size_t bytesInUse() const;
  size_t blockCount() const;
  // Rises whenever a block is given back to the driver: handles may then mean something else.
  uint64_t generation() const;

 private:
  static constexpr size_t kBlockBytes = size_t{64} << 20;
  static constexpr size_t kAlignment = 256;

  std::unique_ptr<Block> makeBlock(size_t bytes, BufferUse use) const;

  const GpuContext& context_;
  mutable std::mutex mutex_;
  std::array<std::vector<std::unique_ptr<Block>>, 3> blocks_;  // by use
  size_t inUse_ = 0;
  uint64_t generation_ = 1;
};

}  // namespace tessera
